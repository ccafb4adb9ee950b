#pragma once

#include "drive/modes/mode_defaults.hpp"
#include "drive/modes/windows.hpp"

namespace servodrome::drive {

// Target reached (bit 10) and speed zero (bit 12) of the statusword, by the windows 606Dh to 6070h or those of the
// device (Configuration::speed_windows).
class VelocityWindows {
 public:
  void restart() {
    target_reached_ = false;
    window_.reset();
  }
  // Call this when the demand changes: it restarts "target reached".
  void changed() { window_.reset(); }
  // `goal` in counts/s; `arrived`: the demand has reached it.
  void update(const Axis& axis, double goal, bool arrived);
  std::uint16_t status() const;

 private:
  bool target_reached_ = false;
  bool speed_zero_ = true;
  Dwell window_{};
  Dwell zero_{};  // time that the axis has moved or, with the device's windows, stood
};

// Profile velocity mode (CiA 402-2).
class ProfileVelocity : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::velocity;

  void enter(Axis& axis);
  void step(Axis& axis);
  void observe(Axis& axis);  // updates the statusword's bits; also called while a stop runs instead of `step`
  void resume(Axis& axis) {
    if (!given_up_) enter(axis);
  }
  void interrupt(Axis& axis, int direction);
  std::uint16_t status(const Axis& axis) const;

 private:
  struct Request {
    std::int32_t target = 0;
    double acceleration = 0.0;  // within 60C5h and 60C6h, counts/s^2
    double deceleration = 0.0;
    std::uint32_t jerk = 0;
    std::int16_t shape = 0;
    double allowed = 0.0;   // the greatest speed, counts/s
    bool inverted = false;  // reversed by an input
    friend bool operator==(const Request&, const Request&) = default;
  };
  static Request request_of(const Axis& axis);
  static double velocity_of(const Request& request, const Axis& axis);  // counts/s
  Cause planning_fault(const Axis& axis, RampShape shape) const;

  Request request_{};
  bool planned_ = false;
  // A limit ended the motion, or the motion could not start without a ramp: the axis waits for another target.
  bool given_up_ = false;
  double wanted_ = 0.0;  // the request in counts/s
  bool slipping_ = false;
  bool clipped_ = false;  // the request is above the greatest speed
  VelocityWindows windows_{};
};

// A manufacturer's mode: the target velocity without ramps.
class ImmediateVelocity : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::velocity;

  void enter(Axis& axis);
  void step(Axis& axis);
  void observe(Axis& axis) { windows_.update(axis, target(axis), true); }
  void resume(Axis&) {}
  void interrupt(Axis& axis, int) {
    held_ = true;
    wanted_ = target(axis);
  }
  std::uint16_t status(const Axis&) const { return windows_.status(); }

 private:
  static double target(const Axis& axis);

  double wanted_ = 0.0;  // counts/s
  bool held_ = false;    // as ProfileVelocity::given_up_
  VelocityWindows windows_{};
};

// Velocity mode (CiA 402-2, "vl"): the ramp function generator of a frequency converter.
class VelocityMode : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::velocity;

  void enter(Axis& axis);
  void controlword(Axis&, std::uint16_t, std::uint16_t now) { word_ = now; }
  void step(Axis& axis);
  void resume(Axis& axis) {
    if (!blocked_) enter(axis);
  }
  void interrupt(Axis& axis, int direction);
  double deceleration(const Axis& axis) const;
  double quick_stop_deceleration(const Axis& axis) const;
  std::uint16_t status(const Axis&) const { return 0; }

  // A velocity in the unit of the set-point 6042h, for 6043h and 6044h.
  static double to_vl(const Axis& axis, double counts_per_s);

 private:
  // The velocity that the input asks for, counts/s; `limited`: it is outside 6046h or 6080h.
  struct Input {
    double velocity = 0.0;
    bool limited = false;
  };
  bool runs() const;
  bool locks() const;
  Input input(const Axis& axis) const;

  std::uint16_t word_ = 0;
  double target_ = 0.0;
  MotionLimits limits_{};
  bool planned_ = false;
  bool ramped_ = false;   // the generator has an output of this mode, which may be locked
  bool blocked_ = false;  // as ProfileVelocity::given_up_
};

// Profile torque mode (CiA 402-2).
class ProfileTorque : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::torque;

  void enter(Axis& axis);
  void step(Axis& axis);
  void resume(Axis& axis) { enter(axis); }
  std::uint16_t status(const Axis& axis) const;

 private:
  static float target(const Axis& axis);
  void begin(const Axis& axis);
  void begin_at(float torque);
  void keep_to_limits(Axis& axis);
  void demand_torque(Axis& axis) const;

  float demand_ = 0.0F;  // fraction of rated torque
  float start_ = 0.0F;   // sin2 slope: where the present ramp began
  float goal_ = 0.0F;
  float phase_ = 1.0F;  // 0 .. 1 along the sin2 ramp
  bool begun_ = false;  // the mode has demanded a torque since it was entered
  bool target_reached_ = false;
};

}  // namespace servodrome::drive
