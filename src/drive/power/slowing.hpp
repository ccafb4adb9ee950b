#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace servodrome::drive {

// Watches whether an axis that brakes without a ramp still becomes slower. It compares the greatest values of one
// period with those of the period before.
class Slowing {
 public:
  // One cycle. `speed`: of the shaft, counts/s, not negative. `current_square`: in the shorted windings, A^2, which
  // shows a motion also without an encoder; 0 if they are not shorted.
  void sample(double speed, double current_square, std::uint32_t period_cycles) {
    constexpr double least_fall = 0.01;  // smaller changes are noise
    present_.speed = std::max(present_.speed, speed);
    present_.current_square = std::max(present_.current_square, current_square);
    if (++cycles_ < period_cycles) return;
    const auto falls = [](double before, double now) { return now < before * (1.0 - least_fall); };
    ended_ = !falls(before_.speed, present_.speed) && !falls(before_.current_square, present_.current_square);
    before_ = present_;
    present_ = {};
    cycles_ = 0;
  }
  // Returns true if in the last whole period neither value became less: something keeps the axis moving.
  bool ended() const { return ended_; }

 private:
  struct Greatest {
    double speed = 0.0;
    double current_square = 0.0;
  };
  Greatest present_{};
  Greatest before_{.speed = std::numeric_limits<double>::infinity()};
  std::uint32_t cycles_ = 0;
  bool ended_ = false;
};

}  // namespace servodrome::drive
