#pragma once

#include <array>

#include "drive/axis.hpp"

namespace servodrome::drive {

// Interpolation time period 60C2h in position-loop cycles, at least 1.
std::uint32_t interpolation_cycles(const Axis& axis);

// A straight line between two cyclic set-points, one step per position-loop cycle. Integer end points: it arrives
// exactly.
class Line {
 public:
  void stand(Counts position, double fraction = 0.0) {
    *this = {};
    from_ = to_ = position;
    fraction_from_ = fraction;
  }
  void go(Counts to, std::uint32_t cycles) {
    from_ = now();
    fraction_from_ = fraction();
    to_ = to;
    step_ = 0;
    steps_ = cycles;
  }
  void step() {
    if (step_ < steps_) ++step_;
  }
  void shift(Counts delta) { from_ += delta, to_ += delta; }
  bool arrived() const { return step_ >= steps_; }
  Counts target() const { return to_; }
  Counts now() const { return from_ + static_cast<Counts>(std::floor(progress())); }
  double fraction() const { return progress() - std::floor(progress()); }
  // Counts per cycle of the piece just travelled.
  double rate() const {
    return steps_ == 0 ? 0.0 : (static_cast<double>(to_ - from_) - fraction_from_) / static_cast<double>(steps_);
  }

 private:
  double progress() const {
    if (steps_ == 0) return fraction_from_;
    if (step_ >= steps_) return static_cast<double>(to_ - from_);
    return fraction_from_ + rate() * static_cast<double>(step_);
  }
  Counts from_ = 0;
  Counts to_ = 0;
  double fraction_from_ = 0.0;
  std::uint32_t step_ = 0;
  std::uint32_t steps_ = 0;
};

// Cyclic synchronous position mode (CiA 402-2 clause 13).
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
  Line line_{};
  std::int64_t given_ = 0;  // the target the line leads to, with its offset
  std::uint32_t quiet_cycles_ = 0;
  bool following_ = false;  // a target was given since the mode was entered
};

// Cyclic synchronous velocity and torque modes (CiA 402-2 clauses 14 and 15).
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

// Interpolated position mode (CiA 402-2 clause 12), linear interpolation 60C0h = 0, with the buffer of 60C4h.
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
  std::uint32_t quiet_cycles_ = 0;
};

}  // namespace servodrome::drive
