#pragma once

#include "drive/trajectory/trajectory.hpp"

namespace servodrome::host {

using drive::MotionLimits;
using drive::MotionState;

// The master's own trajectory: a set-point for each cycle, in counts, counts/s, counts/s^2. Profiles are those of the
// drive's generators (drive/trajectory), time-optimal within limits: jerk-limited if the limits have a jerk, else with
// linear ramps. Time is counted in cycles, so that no profile however long drifts.
class SetPointGenerator {
 public:
  explicit SetPointGenerator(double period_s) : period_s_(period_s) {}

  // From where a new profile starts.
  enum class From {
    present,  // the present set-point: the next advance() is its first period
    end,      // the end of the profile that is done(): what went beyond it belongs to the new one
  };

  // Stands, or moves on with the state's velocity, from here.
  void reset(const MotionState& state);
  // A profile to `target`, which it passes with the magnitude of `end_velocity`. False: a number is not finite or a
  // limit not above zero; nothing changes.
  bool move_to(double target, double end_velocity, const MotionLimits& limits, From from = From::present);
  // A profile to a velocity, signed; at most that of the limits.
  bool run_at(double velocity, const MotionLimits& limits, From from = From::present);
  // The next set-point is the caller's: a synchronised motion.
  void follow(const MotionState& next);
  // Moves the base in which positions are counted; the motion goes on.
  void shift(double distance);

  // The set-point of the next cycle.
  void advance();

  const MotionState& state() const { return state_; }
  // The profile has come to its end; its end velocity goes on.
  bool done() const { return follows_ || elapsed_s() >= trajectory_.duration_s() - rounding * period_s_; }
  double elapsed_s() const { return offset_s_ + static_cast<double>(cycles_) * period_s_; }
  double duration_s() const { return trajectory_.duration_s(); }
  double period_s() const { return period_s_; }

 private:
  // Of a cycle: what sums of periods and durations of profiles may differ by, and are still the same time.
  static constexpr double rounding = 1e-9;

  bool plan(bool planned, const drive::Trajectory& next, From from);
  MotionState start_of(From from) const;

  double period_s_;
  drive::Trajectory trajectory_;
  double base_ = 0.0;      // added to what the trajectory says
  double offset_s_ = 0.0;  // into the trajectory, at its first cycle
  std::uint64_t cycles_ = 0;
  bool follows_ = false;
  bool next_is_set_ = false;
  MotionState state_{};
};

// From `velocity` to `end_velocity`, magnitudes, both at acceleration 0: the way in counts that a brake within `limits`
// takes.
double braking_distance(double velocity, double end_velocity, const MotionLimits& limits);
// The greatest velocity from which that is at most `distance`; `end_velocity` if there is no way.
double velocity_to_slow_within(double distance, double end_velocity, const MotionLimits& limits);

}  // namespace servodrome::host
