#pragma once

#include "trajectory/ramp_plan.hpp"

/// Time-optimal plans of bounded jerk. The jerk is +jerk, 0 or -jerk throughout.
namespace servodrome::trajectory::third_order_plan {

/// Plans a motion to the position `distance` counts from the start, which is passed with the magnitude `end_velocity`
/// >= 0 in the direction of the approach. `resolution`: differences of distance below it count as rounding. Only
/// velocity and acceleration of `start` are used. `list` must be empty.
ramp_plan::Outcome to_position(SegmentList& list, const MotionState& start, double distance, double resolution,
                               double end_velocity, const MotionLimits& limits);

/// Plans a change to `target_velocity` at acceleration 0. `list` must be empty.
void to_velocity(SegmentList& list, const MotionState& start, double target_velocity, const MotionLimits& limits);

}  // namespace servodrome::trajectory::third_order_plan
