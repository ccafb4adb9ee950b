#pragma once

#include "trajectory/trajectory.hpp"

/// Plans in which every velocity ramp is one piece: linear, sin2 and jerk_free. A ramp from v0 to v1 in time T covers
/// (v0 + v1) / 2 * T for each of these shapes, so one plan serves all three; they differ only in their greatest slope.
/// Positions are relative to the start of the plan.
namespace servodrome::trajectory::ramp_plan {

/// Result of a plan: the signed end velocity. `reduced`: its magnitude is below the requested one, because the way is
/// too short.
struct Outcome {
  double end_velocity;
  bool reduced;
};

/// Greatest slope of a ramp of this shape as a multiple of its mean slope.
double steepness(RampShape shape);

/// Plans a motion to the position `distance` counts from the start, which is passed with the magnitude `end_velocity`
/// >= 0 in the direction of the approach. `velocity`: start velocity. `resolution`: differences of distance below it
/// count as rounding. `limits` apply to the mean slope. `list` must be empty.
Outcome to_position(SegmentList& list, double velocity, double distance, double resolution, double end_velocity,
                    const MotionLimits& limits);

/// Plans a change to `target_velocity`. `list` must be empty.
void to_velocity(SegmentList& list, double velocity, double target_velocity, const MotionLimits& limits);

/// State `t` seconds after the begin of a ramp or of a piece of constant velocity, 0 <= t <= its duration.
MotionState state_in(const TrajectorySegment& ramp, double t, RampShape shape);

}  // namespace servodrome::trajectory::ramp_plan
