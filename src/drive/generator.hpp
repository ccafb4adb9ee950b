#pragma once

#include "drive/rounding.hpp"
#include "drive/trajectory_types.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// The set-point generator of one axis: a trajectory on an integer base, advanced once per position-loop cycle and
// re-planned from any state. Positions are application counts (64 bits); the part within a motion is a double relative
// to the base, so that no count is lost however long the axis runs.
class Generator {
 public:
  // Stands at `position`.
  void reset(Counts position) { start_from(position, 0.0); }

  // Starts from a moving axis; continues at `velocity` (counts/s) until a motion is planned.
  void start_from(Counts position, double velocity);

  // Plans from the present state. Distances beyond 2^52 counts are not exact. A refused plan (bad_limits, bad_state)
  // leaves the running motion unchanged.
  Trajectory::Result move_to(Counts target, double end_velocity, const MotionLimits& limits, RampShape shape);
  Trajectory::Result run_at(double velocity, const MotionLimits& limits, RampShape shape);
  // Plans the ramp to rest, wherever it ends. Until another plan replaces it, rest_direction() has the sign of the
  // velocity with which it began.
  Trajectory::Result come_to_rest(const MotionLimits& limits, RampShape shape);
  void rest_again() { come_to_rest(rest_limits_, rest_shape_); }  // the last ramp to rest, from the present state
  double rest_direction() const { return rest_direction_; }
  void hold_rest() { rest_direction_ = 0.0; }  // the shaft has stopped or turned back: the demand stays here

  // Like move_to, but for a motion that has just ended at a velocity: the new motion begins at the exact moment within
  // the last cycle at which the old one ended.
  Trajectory::Result continue_to(Counts target, double end_velocity, const MotionLimits& limits, RampShape shape);

  // Sets the state directly, for the demand of a cyclic mode.
  void place(Counts position, double fraction, double velocity);

  void step(double cycle_seconds);
  // The state after step(), with its position relative to nearest_position().
  MotionState after(double cycle_seconds) const;

  // Shifts the coordinates: every position grows by `delta`.
  void shift(Counts delta) { base_ += delta; }

  bool finished() const { return finished_; }
  bool standing() const { return finished_ && state_.velocity == 0.0; }

  Counts position() const { return base_ + floor_to_integer(state_.position); }
  double fraction() const { return fraction_of(state_.position); }  // 0 .. 1, the part of a count that `position` omits
  Counts nearest_position() const { return base_ + round_to_integer(state_.position); }
  double velocity() const { return state_.velocity; }
  double acceleration() const { return state_.acceleration; }
  double duration_s() const { return trajectory_.duration_s(); }

 private:
  Counts rebase(MotionState& state, RampShape shape) const;
  Trajectory::Result begin(Trajectory::Result result, Counts base, const MotionState& state, double gone_s);
  Trajectory::Result plan_position(MotionState state, double gone_s, Counts target, double end_velocity,
                                   const MotionLimits& limits, RampShape shape);

  Trajectory trajectory_{};
  MotionState state_{};  // relative to base_
  Counts base_ = 0;
  double elapsed_s_ = 0.0;
  double start_s_ = 0.0;      // time that had passed when the plan began (continue_to)
  std::uint64_t cycles_ = 0;  // since the plan
  double last_cycle_s_ = 0.0;
  MotionLimits rest_limits_{};
  RampShape rest_shape_ = RampShape::linear;
  double rest_direction_ = 0.0;
  bool finished_ = true;
  bool planned_ = false;
};

}  // namespace servodrome::drive
