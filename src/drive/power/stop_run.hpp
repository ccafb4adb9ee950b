#pragma once

#include <cmath>
#include <cstdint>

#include "drive/axis.hpp"
#include "drive/power/power_state.hpp"
#include "drive/power/slowing.hpp"

namespace servodrome::drive {

// A stop of the axis that the generator runs instead of the mode: how it brakes, and when it has ended.
class StopRun {
 public:
  // Replaces the stop before.
  void begin(Stop kind) {
    *this = {};
    active_ = true;
    kind_ = kind;
  }
  void end() { active_ = at_limit_ = false; }
  bool active() const { return active_; }

  Stop kind() const { return kind_; }
  void change_kind(Stop kind) { kind_ = kind; }  // of the stop that is under way
  bool without_ramp() const { return kind_ == Stop::current_limit || kind_ == Stop::voltage_limit; }
  bool shorts_windings() const { return active_ && kind_ == Stop::voltage_limit; }

  // A limit caused the stop, or the test motion of a tuning function: the mode continues after it.
  bool at_limit() const { return at_limit_; }
  void set_at_limit() { at_limit_ = true; }
  // Ends a stop at a limit. If the axis is `halted`, the stop goes on as the stop of the halt.
  void end_at_limit(bool halted) {
    at_limit_ = false;
    active_ = halted;
  }

  // One cycle of a stop without a ramp. `current_square`: in the shorted windings, A^2; 0 if they are not shorted.
  void step_without_ramp(const Axis& axis, float current_square) {
    if (kind_ == Stop::voltage_limit) {
      // The current in the shorted windings shows that the axis turns, also without an encoder.
      const float least = standing_current * axis.configuration.motor.rated_current_a;
      const bool quiet = axis.shaft_stands && current_square < least * least;
      braked_to_rest_ = axis.lasts(quiet, braked_, standing_ms);
    }
    slowing_.sample(std::abs(axis.velocity()), static_cast<double>(current_square), axis.cycles(slowing_ms));
  }
  void step_ramp(const Axis& axis) { rest_cycles_ = axis.generator.standing() ? rest_cycles_ + 1 : 0; }

  bool finished(const Axis& axis) const {
    if (kind_ == Stop::voltage_limit) return braked_to_rest_;
    if (kind_ == Stop::current_limit) return axis.shaft_stands;
    return axis.generator.standing() && (axis.shaft_stands || rest_cycles_ >= axis.cycles(rest_wait_ms));
  }
  bool slows_no_more() const { return slowing_.ended(); }

  // The shaft stands if it has been slow for this time ...
  static constexpr std::uint32_t standing_ms = 2;

  Loop loop = Loop::position;
  double deceleration = 0.0;  // planned, of its ramp, counts/s^2

 private:
  // ... and, while its windings are shorted, if their current is below this fraction of the rated one.
  static constexpr float standing_current = 0.05F;
  // A stop also ends this long after its ramp if the shaft still does not stand, because something keeps moving it.
  static constexpr std::uint32_t rest_wait_ms = 2000;
  // A stop without a ramp ends for the same reason after two of these periods in which the axis does not become slower.
  static constexpr std::uint32_t slowing_ms = rest_wait_ms / 2;

  bool active_ = false;
  bool at_limit_ = false;
  bool braked_to_rest_ = false;
  Stop kind_ = Stop::power_off;
  std::uint32_t rest_cycles_ = 0;  // since the end of the ramp
  Dwell braked_{};                 // time at rest with shorted windings
  Slowing slowing_{};
};

}  // namespace servodrome::drive
