#pragma once

#include <optional>

#include "host/scope/recording.hpp"

namespace servodrome::host::scope {

// A change from one resting value to another. Seconds are from the moment at which the value leaves the first one for
// good.
struct StepResponse {
  double from = 0;
  double to = 0;
  double begin_s = 0;  // on the recording's time axis
  double rise_s = 0;   // from 10 % to 90 %
  double overshoot_percent = 0;
  double settling_s = 0;  // until it stays within settling_band of the step around `to`
};
inline constexpr double settling_band = 0.02;

struct Measurement {
  double least = 0;
  double greatest = 0;
  double mean = 0;
  double rms = 0;
  // Where the recording begins and ends at rest (a twentieth of it each, at least 3 samples), and in between it moves
  // by 20 times what is left of motion there.
  std::optional<StepResponse> step{};
};

// Of a channel; the recording has a row at least.
Measurement measure(const Recording& recording, std::size_t channel);

}  // namespace servodrome::host::scope
