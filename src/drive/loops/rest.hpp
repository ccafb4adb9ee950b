#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace servodrome::drive {

// Rest rule of the position loop: prevents an axis with friction and an encoder of finite resolution from hunting
// around a standing position demand.
//
// - An error within the window (one count by default) counts as zero, so that the integral of the velocity loop stops.
// - An integral that has grown until a standing axis breaks loose is larger than the sliding axis needs. It would move
//   the axis past the target, where the same begins again. So as soon as the axis moves, the integral returns to its
//   value at the last standstill. The axis moves towards the target in steps, and friction ends each step.
// - If a step ends on the other side of the target and no nearer to it, friction allows no smaller error: the axis
//   rests there.
struct RestRule {
  float window_counts = 1.0F;
  std::uint16_t still_periods = 40;  // velocity periods without a count until the axis is at rest
  float least_push = 0.0F;           // least change of the integral per velocity period at rest beside the target

  // Once per position cycle: returns the position error for the position loop. `standing`: the demand is constant.
  float position_error(float error_counts, bool standing) {
    if (!standing) {
      demand_stands_ = false;
      stood_at_counts_ = 0.0F;
      step_counts_ = 0.0F;
      open_window_counts_ = window_counts;
      still_ = 0;
      return error_counts;
    }
    demand_stands_ = true;
    const float distance = std::fabs(error_counts);
    if (still_ == still_periods && error_counts != stood_at_counts_) {
      const bool other_side = error_counts * stood_at_counts_ < 0.0F;
      if (other_side && distance <= std::max(std::fabs(stood_at_counts_), step_counts_)) open_window_counts_ = distance;
      step_counts_ = stood_at_counts_ != 0.0F ? std::fabs(error_counts - stood_at_counts_) : 0.0F;
      stood_at_counts_ = error_counts;
    }
    if (distance <= std::max(window_counts, open_window_counts_)) return 0.0F;
    open_window_counts_ = window_counts;
    return error_counts;
  }

  // Once per velocity period: the integral after `step`. `moved`: the encoder counted in this period.
  float integrate(float integral, float step, bool moved) {
    if (!demand_stands_) return integral + step;
    if (moved) {
      if (still_ == still_periods) integral = stood_with_;
      still_ = 0;
    } else if (still_ < still_periods) {
      if (++still_ == still_periods) stood_with_ = integral;
    } else if (step != 0.0F) {
      step = std::copysign(std::max(std::fabs(step), least_push), step);
    }
    return integral + step;
  }

  // The demand is constant and the axis is at rest.
  bool at_rest() const { return demand_stands_ && still_ == still_periods; }

  void leave() { position_error(0.0F, false); }

 private:
  bool demand_stands_ = false;
  std::uint16_t still_ = 0;
  float stood_with_ = 0.0F;       // integral at the moment when the axis came to rest
  float stood_at_counts_ = 0.0F;  // position error at the last rest of the axis; 0: not yet
  float step_counts_ = 0.0F;      // length of the last step
  float open_window_counts_ = 1.0F;
};

}  // namespace servodrome::drive
