#pragma once

#include "drive/axis.hpp"
#include "drive/homing/homing.hpp"

namespace servodrome::drive {

// Homing mode (CiA 402-2): executes a homing method and shifts the coordinates when home is found.
class HomingMode {
 public:
  static constexpr Loop loop = Loop::position;

  void enter(Axis& axis);
  void controlword(Axis&, std::uint16_t before, std::uint16_t now);
  void step(Axis& axis);
  void observe(Axis& axis);  // called instead of `step` while a stop runs
  void halt(Axis&) { halted_ = true; }
  void resume(Axis& axis);
  void interrupt(Axis&, int) {}
  void abort() {
    if (active_) attained_ = false;  // a latch alone is not enough: the way back to home is part of homing
    homing_.abort();
    active_ = start_requested_ = halted_ = false;
  }
  // A fault ends homing with a homing error.
  void fault() {
    error_ = error_ || active_ || start_requested_;
    abort();
  }
  void forget_error(Axis& axis);
  double deceleration(const Axis& axis) const {
    return axis.ramp(axis.objects.homing_acceleration, axis.objects.max_deceleration);
  }
  std::uint16_t status(const Axis& axis) const;
  // until the axis stands, whether home was found or not
  bool running() const { return start_requested_ || active_ || !standing_; }
  int pressing() const { return homing_.pressing(); }
  // The demand is beyond a hard stop, until the shaft's position replaces it.
  bool has_pressed() const { return pressed_ || homing_.pressing() != 0; }
  void shaft_taken_over() { pressed_ = false; }
  bool active() const { return active_; }
  bool awaits_rest() const { return homing_.awaits_rest(); }  // before the first leg
  Counts index_distance() const { return homing_.index_distance(); }
  int leg() const { return homing_.present_leg(); }

 private:
  void start(Axis& axis);
  void fail(Axis& axis, Cause cause);
  std::uint16_t error_code(const Axis& axis, Cause cause) const;
  void carry_out(Axis& axis, const HomingCommand& command);
  void stop(Axis& axis, double least_deceleration = 0.0) const;  // counts/s^2
  void give_up(Axis& axis);
  void take_results(Axis& axis, bool had_latch);
  HomingInputs inputs(const Axis& axis) const;
  MotionLimits motion(const Axis& axis, double velocity) const;

  Homing homing_{};
  HomingCommand last_{};
  bool offset_applies_ = true;
  std::uint32_t ramp_ = 0;  // 609Ah when homing began
  MotionLimits limits_{};   // the greatest speed and the ramps when the leg was planned
  bool start_requested_ = false;
  bool given_up_ = false;  // controlword bit 4 was cleared: ramp to zero
  bool pressed_ = false;   // in the previous cycle the axis pressed against a hard stop
  bool active_ = false;
  bool halted_ = false;
  bool attained_ = false;
  bool error_ = false;
  std::uint16_t shown_code_ = 0;  // shown in 603Fh, see HomingErrorCodes
  bool standing_ = true;          // bit 10
};

}  // namespace servodrome::drive
