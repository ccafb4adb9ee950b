#pragma once

#include <span>
#include <vector>

#include "host/tuning/frequency_response.hpp"

namespace servodrome::host::tuning {

struct SpectrumRequest {
  double lowest_hz = 1.0;
  double highest_hz = 1000.0;  // cut at 0.45 of the sampling rate
  unsigned points_per_decade = 20;
};

// The response of any signal by any other, a sweep or a step for example: both are transformed as a whole, and what
// lies in a band about each point is averaged (the H1 estimate), which also gives the coherence. Bands are at least
// five lines of the transform wide: a recording of one second says nothing below some hertz. Points at which the input
// holds nothing, against the strongest, are left out. Both signals have the same number of samples.
std::vector<ResponsePoint> response_of_signals(std::span<const double> input, std::span<const double> output,
                                               double sample_s, const SpectrumRequest& request);

}  // namespace servodrome::host::tuning
