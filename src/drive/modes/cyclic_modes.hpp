#pragma once

#include <array>

#include "drive/modes/mode_defaults.hpp"
#include "drive/modes/set_point_follower.hpp"

namespace servodrome::drive {

// Cyclic synchronous position mode (CiA 402-2): targets with any regular period, see SetPointFollower.
class CyclicSyncPosition : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::position;

  void enter(Axis& axis);
  void step(Axis& axis);
  void resume(Axis& axis);
  void interrupt(Axis&, int direction) { follower_.hold(direction); }
  std::uint16_t status(const Axis& axis) const;

 private:
  void add_velocity_offset(Axis& axis);
  static double offset_within_limits(const Axis& axis, double offset);
  std::int64_t within_change(Axis& axis, std::int64_t user) const;

  SetPointFollower follower_{};
  std::int64_t given_ = 0;        // the last target, with its offset
  std::int32_t held_offset_ = 0;  // the 60B1h that a limit switch blocked
  bool offset_limited_ = false;   // 60B1h acts in part or not at all
};

// Cyclic synchronous velocity and torque modes (CiA 402-2).
class CyclicSyncVelocity : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::velocity;

  void enter(Axis& axis) { axis.limited = held_ = false; }
  void step(Axis& axis);
  void resume(Axis&) {}
  void interrupt(Axis& axis, int) {
    held_ = true;
    wanted_ = target(axis);
  }
  std::uint16_t status(const Axis& axis) const;

 private:
  static double target(const Axis& axis);

  double wanted_ = 0.0;  // 60FFh with its offset, counts/s
  bool held_ = false;    // a limit ended the motion: the axis waits for another target
};

class CyclicSyncTorque : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::torque;

  void enter(Axis& axis) { axis.limited = false; }
  void step(Axis& axis);
  void resume(Axis&) {}
  std::uint16_t status(const Axis&) const;
};

// Interpolated position mode (CiA 402-2), linear interpolation 60C0h = 0, with the buffer of 60C4h. One missing record
// is bridged, as in SetPointFollower.
class InterpolatedPosition : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::position;
  static constexpr std::size_t capacity = 64;

  void enter(Axis& axis);
  void controlword(Axis&, std::uint16_t, std::uint16_t now);
  bool takes_record(const Axis& axis, std::int32_t record);  // false: the buffer is full
  void data_record(Axis& axis);                              // 60C1h sub 1 was written
  void clear_buffer() { count_ = 0, lost_record_ = false; }
  bool lost_record() const { return lost_record_; }  // a record was refused since the buffer was cleared
  void step(Axis& axis);
  // The end of a halt is not a command, so an axis that a limit holds remains at the limit.
  void resume(Axis&) { following_ = bridging_ = false, demand_.restart(); }
  void interrupt(Axis&, int direction);
  std::uint16_t status(const Axis& axis) const;
  std::size_t buffered() const { return count_; }

 private:
  static constexpr double late_share = 0.25;

  static std::size_t buffer_size(const Axis& axis);
  void stop();
  void take_record(Axis& axis);
  void await_record(Axis& axis);

  std::array<std::int32_t, capacity> buffer_{};
  std::size_t head_ = 0;
  std::size_t count_ = 0;
  Line line_{};
  LineDemand demand_{};
  Counts target_ = 0;       // the last record that was used
  bool enabled_ = false;    // controlword bit 4
  bool given_up_ = false;   // bit 4 was cleared: ramp to rest
  bool following_ = false;  // a record was used since the mode was entered
  bool waited_ = false;     // the line ended without another record
  bool regular_ = false;    // the last record came before the previous line ended
  bool bridging_ = false;   // the line replaces a missing record
  bool lost_record_ = false;
  double bridge_ = 0.0;      // counts per cycle: see bridging_rate
  double record_age_ = 0.0;  // cycles since the last record was written
  InterpolationPeriod period_{};
};

// Interpolated position without a buffer: every SYNC adopts the set-point that the bus has written, and the axis
// reaches it one period later. At a SYNC without a new set-point the axis keeps the last set-point. Two such SYNCs in a
// row, or two periods without a SYNC, raise Cause::interpolation_late.
class SynchronousInterpolation : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::position;

  void enter(Axis& axis);
  void controlword(Axis& axis, std::uint16_t before, std::uint16_t now);
  void data_record() { fresh_ = true; }  // 60C1h sub 1 was written
  void step(Axis& axis);
  // The end of a halt is not a command, so the set-points that came during the halt have no effect.
  void resume(Axis& axis) { follower_.pause(), armed_ = fresh_ = axis.new_set_point = false; }
  void interrupt(Axis&, int direction) { follower_.hold(direction); }
  std::uint16_t status(const Axis& axis) const;

 private:
  void disarm() { follower_.stop(), armed_ = false; }
  bool late(const Axis& axis);
  void follow_target(Axis& axis);

  SetPointFollower follower_{};
  bool enabled_ = false;         // controlword bit 4
  bool given_up_ = false;        // bit 4 was cleared: ramp to rest
  bool fresh_ = false;           // a set-point waits for the SYNC
  bool armed_ = false;           // a SYNC has come since bit 4
  unsigned stale_syncs_ = 0;     // SYNCs since the last set-point
  double waiting_cycles_ = 0.0;  // since the last set-point was adopted
};

}  // namespace servodrome::drive
