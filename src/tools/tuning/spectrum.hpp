#pragma once

#include <span>
#include <vector>

#include "tools/tuning/frequency_response.hpp"

namespace servodrome::master::tuning {

struct SpectrumRequest {
  double lowest_hz = 1.0;
  double highest_hz = 1000.0;  // limited to 0.45 of the sampling rate
  unsigned points_per_decade = 20;
};

// Frequency response between any two signals, for example a sweep or a step. Transforms both signals as a whole and
// averages over a band around each point (H1 estimate), which also gives the coherence. A band has at least five lines
// of the transform, so a recording of one second has no points below a few hertz. Points whose input power is very
// small, relative to the strongest, are left out. Both signals must have the same number of samples.
std::vector<ResponsePoint> response_of_signals(std::span<const double> input, std::span<const double> output,
                                               double sample_s, const SpectrumRequest& request);

}  // namespace servodrome::master::tuning
