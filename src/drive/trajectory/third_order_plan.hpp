#pragma once

#include "drive/trajectory/ramp_plan.hpp"

/// Time-optimal plans of bounded jerk. The jerk is +jerk, 0 or -jerk throughout.
namespace servodrome::drive::third_order_plan {

/// To `distance` counts from the start, passed with the magnitude `end_velocity` >= 0 in the direction of the approach.
/// `resolution`: differences of distance below it are rounding. `start`: its velocity and acceleration count. Appends
/// to an empty list.
ramp_plan::Outcome to_position(SegmentList& list, const MotionState& start, double distance, double resolution,
                               double end_velocity, const MotionLimits& limits);

/// To a velocity at acceleration 0. Appends to an empty list.
void to_velocity(SegmentList& list, const MotionState& start, double target_velocity, const MotionLimits& limits);

}  // namespace servodrome::drive::third_order_plan
