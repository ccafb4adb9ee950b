#pragma once

#include "drive/trajectory/trajectory.hpp"

/// Plans in which every velocity ramp is one piece: linear, sin2 and jerk_free. A ramp from v0 to v1 in time T covers
/// (v0 + v1) / 2 * T whatever its shape, so one plan serves all three; a shape only says how steep the ramp is at its
/// steepest. Positions count from the start of the plan.
namespace servodrome::drive::ramp_plan {

/// What a plan came to: the signed end velocity, lower than asked for if the way was too short to reach it.
struct Outcome {
  double end_velocity;
  bool reduced;
};

/// Steepest slope of a ramp of this shape as a multiple of its mean slope.
double steepness(RampShape shape);

/// To `distance` counts from the start, passed with the magnitude `end_velocity` >= 0 in the direction of the approach.
/// `velocity`: start velocity. `resolution`: differences of distance below it are rounding. The limits are those of the
/// mean slope. Appends to an empty list.
Outcome to_position(SegmentList& list, double velocity, double distance, double resolution, double end_velocity,
                    const MotionLimits& limits);

/// To a velocity. Appends to an empty list.
void to_velocity(SegmentList& list, double velocity, double target_velocity, const MotionLimits& limits);

/// State `t` seconds into a ramp of the shape, 0 <= t <= its duration; also a piece of constant velocity.
MotionState state_in(const TrajectorySegment& ramp, double t, RampShape shape);

}  // namespace servodrome::drive::ramp_plan
