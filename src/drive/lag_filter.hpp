#pragma once

#include <cmath>
#include <cstdint>

#include "drive/rounding.hpp"

namespace servodrome::drive {

// First-order low-pass filter of integers, for smoothing position commands. It does not drift: no unit is lost however
// long it runs, and a constant input is reached exactly.
class LagFilter {
 public:
  // `time_constant` in updates, > 0.
  void configure(double time_constant) { gain_ = -std::expm1(-1.0 / time_constant); }
  void begin(std::int64_t value) { value_ = value; }
  double gain() const { return gain_; }
  std::int64_t update(std::int64_t input) {
    const std::int64_t distance = input - value_;
    std::int64_t step = round_to_integer(gain_ * static_cast<double>(distance));
    if (step == 0 && distance != 0) step = distance > 0 ? 1 : -1;
    value_ += step;
    return value_;
  }

 private:
  double gain_ = 1.0;
  std::int64_t value_ = 0;
};

}  // namespace servodrome::drive
