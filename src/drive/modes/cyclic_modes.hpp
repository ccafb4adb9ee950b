#pragma once

#include <array>

#include "drive/axis.hpp"
#include "drive/modes/line.hpp"

namespace servodrome::drive {

// The interpolation time period 60C2h in position-loop cycles: a real number, at least 1.
class InterpolationPeriod {
 public:
  double cycles(const Axis& axis) {
    const Objects& objects = axis.objects;
    if (objects.interpolation_time_period_value != value_ || objects.interpolation_time_index != index_) update(axis);
    return cycles_;
  }

 private:
  void update(const Axis& axis);

  std::uint8_t value_ = 0;
  std::int8_t index_ = 0;
  double cycles_ = 1.0;
};

// Cyclic synchronous position mode (CiA 402-2). Targets are due one period 60C2h apart; the drive interpolates between
// them on that time base of its own, not on the moments they arrive: a target may come up to a cycle early or late
// (jitter of bus and master, or a period that is no multiple of the cycle) without a trace in the velocity.
class CyclicSyncPosition {
 public:
  static constexpr Loop loop = Loop::position;

  void enter(Axis& axis);
  void controlword(Axis&, std::uint16_t, std::uint16_t) {}
  void step(Axis& axis);
  void halt(Axis&) {}
  void resume(Axis& axis) { enter(axis); }
  void interrupt(Axis&) { following_ = false; }
  double deceleration(const Axis& axis) const { return axis.objects.profile_deceleration * axis.units.acceleration; }
  std::uint16_t status(const Axis& axis) const;

 private:
  void follow(Axis& axis, std::int64_t user);

  Line line_{};
  InterpolationPeriod period_{};
  std::int64_t given_ = 0;  // the target the line leads to, with its offset
  double due_ = 0.0;        // cycles until the line's target is due; below 0: since
  double phase_ = 0.0;      // mean of due_ when the next target comes
  bool following_ = false;  // a target was given since the mode was entered
  bool regular_ = false;    // the last target came when it was due
};

// Cyclic synchronous velocity and torque modes (CiA 402-2).
class CyclicSyncVelocity {
 public:
  static constexpr Loop loop = Loop::velocity;

  void enter(Axis& axis) { axis.limited = false; }
  void controlword(Axis&, std::uint16_t, std::uint16_t) {}
  void step(Axis& axis);
  void halt(Axis&) {}
  void resume(Axis&) {}
  void interrupt(Axis&) {}
  double deceleration(const Axis& axis) const { return axis.objects.profile_deceleration * axis.units.acceleration; }
  std::uint16_t status(const Axis&) const;
};

class CyclicSyncTorque {
 public:
  static constexpr Loop loop = Loop::torque;

  void enter(Axis& axis) { axis.limited = false; }
  void controlword(Axis&, std::uint16_t, std::uint16_t) {}
  void step(Axis& axis);
  void halt(Axis&) {}
  void resume(Axis&) {}
  void interrupt(Axis&) {}
  double deceleration(const Axis& axis) const { return axis.objects.profile_deceleration * axis.units.acceleration; }
  std::uint16_t status(const Axis&) const;
};

// Interpolated position mode (CiA 402-2), linear interpolation 60C0h = 0, with the buffer of 60C4h.
class InterpolatedPosition {
 public:
  static constexpr Loop loop = Loop::position;
  static constexpr std::size_t capacity = 64;

  void enter(Axis& axis);
  void controlword(Axis&, std::uint16_t, std::uint16_t now);
  void data_record(Axis& axis);  // 60C1h sub 1 was written
  void clear_buffer() { count_ = 0; }
  void step(Axis& axis);
  void halt(Axis&) {}
  void resume(Axis&) { following_ = false; }
  void interrupt(Axis&) { following_ = false; }
  double deceleration(const Axis& axis) const { return axis.objects.profile_deceleration * axis.units.acceleration; }
  std::uint16_t status(const Axis& axis) const;
  std::size_t buffered() const { return count_; }

 private:
  std::array<std::int32_t, capacity> buffer_{};
  std::size_t head_ = 0;
  std::size_t count_ = 0;
  Line line_{};
  bool enabled_ = false;    // controlword bit 4
  bool following_ = false;  // a record was taken since the mode was entered
  bool waited_ = false;     // the line's end has passed without another record
  bool regular_ = false;    // the last record came before the end of the line before
  InterpolationPeriod period_{};
};

}  // namespace servodrome::drive
