#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace servodrome::drive {

/// Shape of a velocity ramp, motion profile type 6086h (CiA 402-2: 0 linear, 1 sin2, 2 jerk-free, 3 jerk-limited).
enum class RampShape : std::uint8_t { linear = 0, sin2 = 1, jerk_free = 2, jerk_limited = 3 };

/// A state of motion in counts, counts/s, counts/s^2; the position counts from whatever base the caller chose.
struct MotionState {
  double position;
  double velocity;
  double acceleration;
};

/// Magnitudes, all finite and greater than zero, in counts/s, counts/s^2, counts/s^3. `acceleration` bounds the change
/// while the speed grows, `deceleration` while it falls, in both directions. `jerk` is used by RampShape::jerk_limited
/// only.
struct MotionLimits {
  double velocity;
  double acceleration;
  double deceleration;
  double jerk;
};

/// A piece of a trajectory. Of the cubic pieces (linear, jerk_limited) `acceleration` holds at the piece's begin and
/// `jerk` throughout; of the sin2 and jerk_free pieces `acceleration` is the mean over the piece, and `jerk` is 0.
struct TrajectorySegment {
  double begin_s;
  double duration_s;
  double position;  ///< Relative to the start of the trajectory.
  double velocity;
  double acceleration;
  double jerk;
};

/// The pieces of a trajectory in order of time, each beginning where the one before it ends.
struct SegmentList {
  static constexpr std::size_t capacity =
      16;  ///< The longest plan, through velocity 0 with separate limits, has 12 pieces.
  std::array<TrajectorySegment, capacity> segments{};
  std::size_t count = 0;
};

/// A planned motion: a value without heap, a function of the time since it was planned.
///
/// Planning takes bounded time: everything is in closed form but one root of a convex quartic in some of the
/// jerk-limited position plans, which takes a fixed greatest number of steps (quartic.hpp).
///
/// What is optimal. linear is time-optimal for every start velocity; the start acceleration is ignored (the velocity is
/// continuous). sin2 and jerk_free are the linear plan with the limits divided by pi/2 and 15/8, so that the peak of
/// each ramp meets the limit. jerk_limited is time-optimal from every start that can keep the limits if acceleration ==
/// deceleration, also where it has to overshoot and come back, and if not, as long as the axis does not change
/// direction. Where it does, with separate limits, the ramp through velocity 0 is the fastest the two limits allow, and
/// what follows is optimal; the limits are kept and the end is exact, but the whole is not proven optimal. A start
/// outside the limits is brought inside as directly as the jerk allows: acceleration first; a velocity too high comes
/// down to the limit without falling below it.
class Trajectory {
 public:
  enum class Result : std::uint8_t {
    ok,
    end_velocity_reduced,  ///< Planned, but the way is too short to reach the end velocity without backing up for a
                           ///< run.
    bad_state,             ///< Start, target or velocity is not finite; the trajectory is unchanged.
    bad_limits             ///< A limit is not finite or not above zero; the trajectory is unchanged.
  };

  /// Moves to `target` (counts, same base as `start`) and passes it, in the direction of the approach, with the
  /// magnitude of `end_velocity` (6082h; at most limits.velocity; 0 stops there). `start` may lie outside the limits.
  /// If the axis is too fast to stop at (or slow down to the end velocity by) the target, it goes past and comes back.
  Result plan_position(const MotionState& start, double target, double end_velocity, const MotionLimits& limits,
                       RampShape shape);

  /// Goes to `target_velocity` (counts/s, clamped to +-limits.velocity) as fast as the limits allow and keeps it.
  Result plan_velocity(const MotionState& start, double target_velocity, const MotionLimits& limits, RampShape shape);

  /// State at a time since the plan's start; before 0 the start, from duration_s() on the exact end continued at the
  /// end velocity.
  MotionState at(double seconds_since_plan) const;

  /// Time until the end state is reached, in seconds.
  double duration_s() const { return duration_s_; }

  RampShape shape() const { return shape_; }

  /// The pieces, for display and test.
  const SegmentList& segments() const { return list_; }

 private:
  SegmentList list_{};
  RampShape shape_ = RampShape::linear;
  double duration_s_ = 0.0;
  double base_ = 0.0;  ///< Position of the start, added last so that short moves far from zero keep their digits.
  MotionState end_{};  ///< Exact end state, absolute.
};

}  // namespace servodrome::drive
