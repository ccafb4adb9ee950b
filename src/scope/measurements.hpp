#pragma once

#include <optional>

#include "scope/recording.hpp"

namespace servodrome::scope {

// Change from one resting value to another. Durations count from `begin_s`, when the value finally leaves the initial
// one.
struct StepResponse {
  double from = 0;
  double to = 0;
  double begin_s = 0;  // on the recording's time axis
  double rise_s = 0;   // from 10 % to 90 %
  double overshoot_percent = 0;
  double settling_s = 0;  // until it stays within settling_band of the step height around `to`
};
inline constexpr double settling_band = 0.02;

struct Measurement {
  double least = 0;
  double greatest = 0;
  double mean = 0;
  double rms = 0;
  // Set if the recording begins and ends at rest (for a twentieth of its rows each, at least 3), and the difference
  // between the two is more than 20 times the remaining noise and at least half of the curve's range.
  std::optional<StepResponse> step{};
};

// Measures a channel; the recording must have at least one row.
Measurement measure(const Recording& recording, std::size_t channel);

}  // namespace servodrome::scope
