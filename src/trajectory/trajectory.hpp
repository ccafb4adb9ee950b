#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace servodrome::trajectory {

/// Shape of a velocity ramp, motion profile type 6086h (CiA 402-2: 0 linear, 1 sin2, 2 jerk-free, 3 jerk-limited).
enum class RampShape : std::uint8_t { linear = 0, sin2 = 1, jerk_free = 2, jerk_limited = 3 };

/// A state of motion in counts, counts/s, counts/s^2. The caller chooses the zero of the position.
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
  friend bool operator==(const MotionLimits&, const MotionLimits&) = default;
};

/// A piece of a trajectory. In cubic pieces (linear, jerk_limited) `acceleration` is the value at the begin and `jerk`
/// is constant. In sin2 and jerk_free pieces `acceleration` is the mean over the piece, and `jerk` is 0.
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
  /// The longest plan, through velocity 0 with separate limits, has 12 pieces.
  static constexpr std::size_t capacity = 16;
  std::array<TrajectorySegment, capacity> segments{};
  std::size_t count = 0;
};

/// A planned motion, as a function of the time since it was planned. A value type without heap memory.
///
/// Planning takes bounded time. All formulas are in closed form, except one root of a convex quartic in some
/// jerk-limited position plans, whose number of steps is limited (quartic.hpp).
///
/// Optimality: linear is time-optimal for every start velocity; it ignores the start acceleration (the velocity is
/// continuous). sin2 and jerk_free are the linear plan with the limits divided by pi/2 and 15/8, so that the greatest
/// slope of each ramp meets the limit. jerk_limited with acceleration == deceleration is time-optimal from every start
/// that can keep the limits, also where the axis has to overshoot and come back. With separate limits it is
/// time-optimal as long as the axis does not change direction. If it does, the ramp through velocity 0 is the fastest
/// that the two limits allow and the rest is optimal; limits and end are exact, but the whole is not proven optimal. A
/// start outside the limits is brought inside as directly as the jerk allows: first the acceleration, then the
/// velocity, which comes down to its limit without falling below it.
class Trajectory {
 public:
  enum class Result : std::uint8_t {
    ok,
    /// Planned, but the way is too short to reach the end velocity without first moving back.
    end_velocity_reduced,
    bad_state,  ///< Start, target or velocity is not finite; the trajectory is unchanged.
    bad_limits  ///< A limit is not finite or not above zero; the trajectory is unchanged.
  };

  /// Plans a motion to `target` (counts, same zero as `start`), which is passed in the direction of the approach with
  /// the magnitude of `end_velocity` (6082h; at most limits.velocity; 0 stops there). `start` may lie outside the
  /// limits. An axis too fast to stop at the target (or to reach the end velocity there) overshoots and comes back.
  Result plan_position(const MotionState& start, double target, double end_velocity, const MotionLimits& limits,
                       RampShape shape);

  /// Plans the fastest change to `target_velocity` (counts/s, clamped to +-limits.velocity), which is then kept.
  Result plan_velocity(const MotionState& start, double target_velocity, const MotionLimits& limits, RampShape shape);

  /// State at a time since the plan's start. Times before 0 return the start; from duration_s() on the motion continues
  /// from the exact end at the end velocity.
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
  double base_ = 0.0;  ///< Position of the start; added last, so that short moves far from zero keep their precision.
  MotionState end_{};  ///< Exact end state, absolute.
};

}  // namespace servodrome::trajectory
