#pragma once

#include <limits>

#include "drive/axis.hpp"
#include "drive/cause_set.hpp"
#include "drive/loops/i2t.hpp"
#include "drive/modes/windows.hpp"
#include "drive/open_phase.hpp"

namespace servodrome::drive {

// The monitors of one axis, run once per position-loop cycle: the causes and warnings that are present.
class Supervision {
 public:
  struct Situation {
    std::uint32_t hardware_faults = 0;  // since the last cycle, because a comparator may be active for one tick only
    bool energised = false;             // the power stage is on
    bool dc_link_expected = false;      // the DC link should have its voltage
    bool brake_closed = false;          // engaged for longer than its delay
    bool homing = false;
    bool profiled = false;  // operation is enabled in a mode with ramps 6083h, 6084h
    int pressing = 0;  // direction (-1, +1) in which homing presses against a hard stop: there a following error, and
                       // the torque limit, are intended
    Loop loop = Loop::off;
  };

  // The HardwareFault bit that raises this cause; 0: none does.
  static std::uint32_t comparator_of(Cause cause);

  void reset() { *this = {}; }
  void configure(const Axis& axis);  // adopts the configuration and keeps measured values
  void cycle(Axis& axis, const Feedback& feedback, const Situation& situation);
  OpenPhase& open_phase() { return open_phase_; }  // it samples at its own ticks

  const CauseSet& present() const { return present_; }
  bool warning() const { return warning_; }
  bool chopper() const { return chopper_; }
  double i2t_utilisation_percent() const { return i2t_.utilisation_percent(); }
  double stage_utilisation_percent() const { return stage_i2t_.utilisation_percent(); }
  // Fraction of rated torque that the overload allows, with Monitors::overload_limits_torque.
  float allowed_torque() const { return allowed_torque_; }

 private:
  void supply(const Axis& axis, const Feedback& feedback, const Situation& situation);
  void temperatures(const Axis& axis, const Feedback& feedback);
  void limit_torque(const Axis& axis, const Feedback& feedback);
  void motion(Axis& axis, const Situation& situation);
  void limit_switches(const Axis& axis, const Situation& situation);

  static constexpr std::uint32_t encoder_return_ms = 20;  // until the measured speed is valid again

  CauseSet present_{};
  std::uint32_t encoder_cycles_ = 0;  // remaining cycles of that time
  I2t i2t_{};
  I2t stage_i2t_{};
  float allowed_torque_ = std::numeric_limits<float>::max();
  bool warning_ = false;
  bool chopper_ = false;
  Dwell following_{};
  Dwell velocity_{};
  Dwell jammed_{};
  Dwell under_voltage_{};
  Dwell power_failure_{};
  Dwell brake_resistor_{};
  OpenPhase open_phase_{};
  std::uint32_t last_signals_ = 0;
  float over_speed_rpm_ = 0.0F;  // limit in force
  Dwell kept_below_{};           // time well below a lowered limit, until it comes into force
  Counts brake_position_ = 0;
  Counts index_position_ = 0;  // position of the last index pulse
  bool brake_was_closed_ = false;
};

}  // namespace servodrome::drive
