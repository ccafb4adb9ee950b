#include <cmath>
#include <fmt/format.h>

#include "watch_terms.hpp"

// Checks power stage, power states and torque.
namespace servodrome::motion {

namespace {

// Returns true for one transition of the CiA 402 state machine (with the additional one of some makers out of Quick
// stop active).
bool step_allowed(PowerState from, PowerState to) {
  using enum PowerState;
  if (from == to || to == not_ready_to_switch_on) return true;
  if (to == fault_reaction_active) return from != fault;
  switch (from) {
    case not_ready_to_switch_on: return one_of(to, {switch_on_disabled, fault});
    case switch_on_disabled: return one_of(to, {ready_to_switch_on, fault});
    case ready_to_switch_on: return one_of(to, {switched_on, switch_on_disabled, fault});
    case switched_on: return one_of(to, {operation_enabled, ready_to_switch_on, switch_on_disabled, fault});
    case operation_enabled:
      return one_of(to, {switched_on, ready_to_switch_on, switch_on_disabled, quick_stop_active, fault});
    case quick_stop_active: return one_of(to, {switch_on_disabled, operation_enabled, ready_to_switch_on, fault});
    case fault_reaction_active: return to == fault;
    case fault: return to == switch_on_disabled;
  }
  return false;
}

// Up to three transitions may happen within a tick, because more than one command may come.
bool allowed(PowerState from, PowerState to) {
  if (step_allowed(from, to)) return true;
  for (std::uint8_t one = 0; one < 8; ++one) {
    const auto by = static_cast<PowerState>(one);
    if (!step_allowed(from, by)) continue;
    if (step_allowed(by, to)) return true;
    for (std::uint8_t two = 0; two < 8; ++two) {
      const auto then = static_cast<PowerState>(two);
      if (step_allowed(by, then) && step_allowed(then, to)) return true;
    }
  }
  return false;
}

}  // namespace

void Watch::power() {
  const bool allowed_here =
      has_stage(state_) || (state_ == PowerState::switched_on && drive_.policy().power.energised_in_switched_on) ||
      // the brake closes before the power is switched off
      (drive_.configuration().has_brake() && tick_ - state_since_ < ms(drive_.configuration().brake_engage_ms + 2.0));
  unpowered_ticks_ = (pwm_ || shorted_) && !allowed_here ? unpowered_ticks_ + 1 : 0;
  if (unpowered_ticks_ > cycle_ticks) {
    fail("torque-without-operation", fmt::format("the stage is on in {}, {:.2f} Nm at {:.1f} rpm", drive::name(state_),
                                                 axis_.plant().torque_nm(), rpm(velocity_)));
  }
  // The power is switched off at the end of a stop.
  if (had_pwm_ && !pwm_ && !shorted_ && was_powered_ && judgeable_ && acceleration_ > 0.0 &&
      axis_.feedback().hardware_faults == 0) {
    const drive::FaultRow* fault = drive_.shown_fault();
    std::int16_t code = 0;
    bool judged = true;
    switch (before_) {
      case PowerState::quick_stop_active:
        code = objects_.quick_stop_option_code;
        judged = !one_of(state_, {PowerState::fault, PowerState::fault_reaction_active});
        break;
      case PowerState::fault_reaction_active:
        code = objects_.fault_reaction_option_code;
        judged = fault != nullptr && fault->reaction == drive::Reaction::option_code;
        break;
      case PowerState::operation_enabled:
        judged =
            !one_of(state_, {PowerState::fault, PowerState::fault_reaction_active, PowerState::not_ready_to_switch_on});
        switch (drive::command_of(objects_.controlword)) {
          case drive::Command::shutdown: code = objects_.shutdown_option_code; break;
          case drive::Command::switch_on: code = objects_.disable_operation_option_code; break;
          case drive::Command::quick_stop: code = objects_.quick_stop_option_code; break;
          default: judged = false;
        }
        break;
      default: judged = false;
    }
    // While the brake opens it still holds the axis, so there is no motion that a ramp could end.
    if (tick_ - pwm_before_ <= ms(drive_.configuration().brake_release_ms)) judged = false;
    // Of two controlwords the first one may have ended the operation with another option code.
    if (before_ == PowerState::operation_enabled && two_words()) judged = false;
    // Disable voltage does not wait for the end of a ramp.
    if (drive::command_of(objects_.controlword) == drive::Command::disable_voltage) judged = false;
    const bool ramp = code == 1 || code == 2 || code == 3 || code == 5 || code == 6 || code == 7;
    // The stop may have begun and ended within this tick.
    const std::int64_t began = told_to_stop() ? stop_.began : tick_;
    const double passed = static_cast<double>(tick_ - began) * tick_s;
    const bool in_time = !told_to_stop() || (stop_.seconds < 1e9 && passed < stop_.seconds + 0.5);
    // A stop that came to rest is over. If the shaft moves while the brake closes, a load moves it.
    const bool rested = stood_ >= began - ms(drive_.configuration().brake_engage_ms + 5.0);
    // Judges a stop with a ramp that did not come to rest, unless its time is over.
    if (judged && ramp && in_time && !rested && std::abs(velocity_) > 3.0 * still_rpm / 60.0 * counts_per_revolution_) {
      fail("let-go-in-motion", fmt::format("power goes at {:.0f} rpm, {:.1f} ms after the stop began in {}",
                                           rpm(velocity_), 1000.0 * passed, drive::name(before_)));
    }
  }
}

void Watch::coasting() {
  const bool free = !pwm_ && !shorted_ && around_->load_share == 0.0 && !around_->locked;
  const double speed = std::abs(velocity_);
  // The current that still flows through the diodes may drive the shaft.
  const bool current = std::abs(axis_.plant().torque_nm()) > 0.02 * rated_torque_nm_;
  if (!free || current || pwm_ != had_pwm_) {
    slowest_ = speed;
    return;
  }
  slowest_ = std::min(slowest_, speed);
  // A cogging torque may accelerate the shaft again after it has braked it.
  if (speed > slowest_ + 60.0 / 60.0 * counts_per_revolution_) {
    fail("coasting-gains-speed", fmt::format("{:.1f} rpm, after {:.1f} rpm", rpm(speed), rpm(slowest_)));
  }
}

void Watch::states() {
  if (state_ == before_) return;
  if (!was_powered_) return;
  if (!allowed(before_, state_)) {
    return fail("wrong-transition", fmt::format("{} to {}", drive::name(before_), drive::name(state_)));
  }
  if (state_ == PowerState::operation_enabled && !two_words() &&
      drive::command_of(objects_.controlword) != drive::Command::enable_operation) {
    fail("enabled-unasked", fmt::format("from {}, controlword {:04X}h", drive::name(before_), objects_.controlword));
  }
  if (state_ == PowerState::fault || state_ == PowerState::fault_reaction_active) {
    if (!one_of(before_, {PowerState::fault, PowerState::fault_reaction_active})) fault_since_ = tick_;
  }
}

void Watch::torque() {
  const std::int64_t limits = std::int64_t{objects_.max_torque} << 32 |
                              std::int64_t{objects_.positive_torque_limit} << 16 | objects_.negative_torque_limit;
  if (limits != torque_limits_) {
    torque_limits_ = limits;
    torque_limits_since_ = tick_;
  }
  if (!pwm_ || tick_ - torque_limits_since_ <= ms(20)) {
    torque_over_ = 0;
    return;
  }
  const double limit = std::max(std::min(objects_.max_torque, objects_.positive_torque_limit),
                                std::min(objects_.max_torque, objects_.negative_torque_limit)) *
                       0.001;
  const double share = std::abs(axis_.plant().torque_nm()) / rated_torque_nm_;
  // Allows for the overshoot of the current loop, and for the nameplate's torque constant, which is that of a cold
  // motor.
  const bool over = share > 1.15 * limit + 0.3 && (around_->injected & spoils_motion) == 0 &&
                    std::abs(velocity_) < greatest_speed() && around_->supply_share >= 0.8;
  torque_over_ = over && tick_ - voltage_spent_ > ms(50) ? torque_over_ + 1 : 0;
  if (torque_over_ > ms(5)) {
    fail("torque-beyond-limit",
         fmt::format("{:.0f} % of the rated torque, {:.0f} % are allowed", 100.0 * share, 100.0 * limit));
  }
}

}  // namespace servodrome::motion
