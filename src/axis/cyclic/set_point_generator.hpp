#pragma once

#include <optional>

#include "trajectory/trajectory.hpp"

namespace servodrome::master {

using trajectory::MotionLimits;
using trajectory::MotionState;

// The master's own trajectory: one set-point for each cycle, in counts, counts/s, counts/s^2. The profiles are those of
// the drive's generators (drive/trajectory), time-optimal within the limits: jerk-limited if the limits have a jerk,
// otherwise with linear ramps. Time is counted in cycles, so that even long profiles do not drift.
class SetPointGenerator {
 public:
  explicit SetPointGenerator(double period_s) : period_s_(period_s) {}

  // Start of a new profile.
  enum class From {
    present,  // at the present set-point; the next advance() is the first period
    end,      // at the end of the profile that is done(); time elapsed beyond that end counts for the new profile
  };

  // Sets the state without a profile: at standstill, or moving with the constant velocity of `state`.
  void reset(const MotionState& state);
  // A profile to `target`, passed with the magnitude of `end_velocity`. False if a number is not finite or a limit is
  // not above zero; then nothing changes.
  bool move_to(double target, double end_velocity, const MotionLimits& limits, From from = From::present);
  // A profile to a signed velocity, at most the velocity of the limits.
  bool run_at(double velocity, const MotionLimits& limits, From from = From::present);
  // Plans the last profile again from this state, as if the command came now. Without a profile: as reset().
  void restart(const MotionState& state);
  // The caller supplies the next set-point: for synchronised motion.
  void follow(const MotionState& next);
  // Shifts the origin of the positions; the motion continues.
  void shift(double distance);

  // Computes the set-point of the next cycle.
  void advance();

  const MotionState& state() const { return state_; }
  // True once the profile has ended; the axis then continues at the end velocity.
  bool done() const { return follows_ || elapsed_s() >= trajectory_.duration_s() - rounding * period_s_; }
  double elapsed_s() const { return offset_s_ + static_cast<double>(cycles_) * period_s_; }
  double duration_s() const { return trajectory_.duration_s(); }
  double period_s() const { return period_s_; }

 private:
  // A fraction of a cycle: the permitted rounding difference between a sum of periods and the duration of a profile.
  static constexpr double rounding = 1e-9;

  struct Order {
    bool is_position = true;
    double goal = 0.0;          // position or velocity
    double end_velocity = 0.0;  // of a position
    MotionLimits limits{};
  };

  bool carry_out(const Order& order, From from);
  MotionState start_of(From from) const;

  double period_s_;
  trajectory::Trajectory trajectory_;
  std::optional<Order> order_{};  // of the present profile
  double base_ = 0.0;             // added to the trajectory's positions
  double offset_s_ = 0.0;         // time in the trajectory at its first cycle
  std::uint64_t cycles_ = 0;
  bool follows_ = false;
  bool next_is_set_ = false;
  MotionState state_{};
};

// Distance in counts to brake from `velocity` to `end_velocity` within `limits`. Velocities are magnitudes; the
// acceleration is 0 at both ends.
double braking_distance(double velocity, double end_velocity, const MotionLimits& limits);
// The greatest velocity whose braking distance is at most `distance`; `end_velocity` if there is no distance.
double velocity_to_slow_within(double distance, double end_velocity, const MotionLimits& limits);

}  // namespace servodrome::master
