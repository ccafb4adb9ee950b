#pragma once

#include <array>

#include "drive/modes/mode_defaults.hpp"
#include "drive/modes/windows.hpp"

namespace servodrome::drive {

// Profile position mode (CiA 402-2): set-points with a queue, immediate change, change on set-point.
class ProfilePosition : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::position;

  void enter(Axis& axis);
  void controlword(Axis& axis, std::uint16_t before, std::uint16_t now);
  void step(Axis& axis);
  void halt(Axis& axis);
  void resume(Axis& axis);
  void interrupt(Axis&, int);  // a limit switch ended the motion short of its target
  std::uint16_t status(const Axis& axis) const;

 private:
  struct SetPoint {
    std::int64_t target = 0;  // user units
    bool relative = false;
    bool pass_previous = false;  // change on set-point: the previous set-point is passed at its profile velocity
    double velocity = 0.0;       // counts/s; from here on: the values at the time when the set-point was given
    double end_velocity = 0.0;
    double start_velocity = 0.0;     // of a motion from rest; 0: none
    std::uint32_t acceleration = 0;  // user units
    std::uint32_t deceleration = 0;
    std::uint32_t jerk = 0;
    RampShape shape = RampShape::linear;
    std::uint16_t option = 0;  // 60F2h
  };
  static constexpr std::size_t capacity = 32;

  SetPoint capture(const Axis& axis, std::uint16_t word) const;
  bool room(const Axis& axis) const { return count_ < axis.policy.positioning.queue && !unbreakable(axis); }
  bool unbreakable(const Axis& axis) const {
    return axis.policy.ramps.jerk_limited_single_symmetric && running_ &&
           running_set_point_.shape == RampShape::jerk_limited;
  }
  SetPoint pop();
  bool may_chain(const Axis& axis);
  void track(Axis& axis);
  void keep_to_limits(Axis& axis);
  void brake_before_limit(Axis& axis);
  bool brakes_before_limit(Axis& axis);
  void keep_to_profile(Axis& axis);
  bool reaches_target(const Axis& axis, const MotionLimits& limits) const;
  Cause planning_fault(const Axis& axis, const SetPoint& set_point) const;
  bool resolve_target(Axis& axis, const SetPoint& set_point, Counts& target);
  void start(Axis& axis, const SetPoint& set_point, bool chained);
  void plan(Axis& axis, const SetPoint& set_point, Counts target, bool chained);
  static bool start_at_speed(Axis& axis, const SetPoint& set_point, Counts target, const MotionLimits& limits);

  std::array<SetPoint, capacity> queue_{};
  std::size_t head_ = 0;
  std::size_t count_ = 0;
  SetPoint running_set_point_{};
  SetPoint immediate_{};
  bool immediate_pending_ = false;
  bool given_ = false;  // a set-point was given since the mode was entered
  bool running_ = false;
  bool braking_ = false;      // brakes before a software limit, and continues from rest
  bool passing_ = false;      // the running motion ends at profile velocity, as the next set-point requires
  bool acknowledge_ = false;  // from the accepted edge of bit 4 until bit 4 falls
  bool interrupted_ = false;
  bool target_reached_ = true;
  Counts target_ = 0;  // of the running or last motion, application counts
  std::int64_t target_user_ = 0;
  double direction_ = 1.0;  // direction of that target
  double allowed_ = 0.0;    // the greatest speed when the motion was planned, counts/s
  MotionLimits planned_{};  // the limits of that plan
  Dwell window_{};
  Dwell rest_{};  // standstill of the shaft between two set-points
  std::uint32_t rest_wait_cycles_ = 0;
};

}  // namespace servodrome::drive
