#include <algorithm>
#include <cmath>

#include "drive/drive.hpp"

// Faults and warnings of the drive: from their causes to the reaction, the error code and the reset.
namespace servodrome::drive {

const FaultRow* Drive::row(Cause cause) const {
  for (const FaultRow& row : policy_.faults.rows) {
    if (row.cause == cause) return &row;
  }
  return nullptr;
}

void Drive::choose_comparators() {
  measured_.comparators = measured_.reported = 0;
  for (const FaultRow& row : policy_.faults.rows) {
    const std::uint32_t comparator = Supervision::comparator_of(row.cause);
    measured_.comparators |= comparator;
    if (!axis_.configuration.ignored.test(row.cause)) measured_.reported |= comparator;
  }
}

// Not inlined, to save registers in the tick.
[[gnu::noinline]] void Drive::trip(std::uint32_t faults, bool cycle_due, Actuation& actuation) {
  // The first comparator counts, because later ones are its consequence. An ignored one must not hide another.
  if (measured_.tripped == 0) measured_.tripped = faults & measured_.reported;
  const bool acts = (measured_.tripped | (faults & measured_.comparators)) != 0;
  if (acts && !cycle_due && outputs_.pwm_enabled) {
    // A comparator acts at once, not at the end of the cycle.
    outputs_.pwm_enabled = false;
    actuation.pwm_enabled = false;
  }
}

void Drive::raise(Cause cause) {
  const FaultRow* fault = row(cause);
  if (fault == nullptr || faults_.active.test(cause) || axis_.configuration.ignored.test(cause)) return;
  if (fault->reaction == Reaction::none) return;
  faults_.active.set(cause);
  if (fault->reset == ResetRule::clear_multi_turn) faults_.multi_turn_cleared = false;
  if (fault->reset == ResetRule::power_off) faults_.kept.set(cause);
  if (faults_.shown == nullptr || !policy_.faults.first_is_shown) show_fault(*fault);
  // the callback sees the drive's state at the time of the fault
  if (events_ != nullptr) events_->fault_raised(*fault);
  react_to_fault(*fault);
}

void Drive::show_fault(const FaultRow& fault) {
  faults_.shown = &fault;
  axis_.objects.error_code = fault.code;
}

void Drive::inject(Cause cause, bool present) { faults_.injected.set(cause, present); }

void Drive::react_to_fault(const FaultRow& fault) {
  if (state_ == PowerState::fault) return;
  Stop stop = fault.reaction == Reaction::power_off ? Stop::power_off
                                                    : stop_of_option_code(axis_.objects.fault_reaction_option_code);
  if (fault.reaction == Reaction::angle_lost && stop != Stop::voltage_limit) stop = Stop::power_off;
  const bool reacting = state_ == PowerState::fault_reaction_active;
  state_ = PowerState::fault_reaction_active;
  waiting_.waits = false;
  const bool controlled = fault.reaction == Reaction::option_code;
  if (stop == Stop::power_off && controlled && hold_for_brake()) {
    // the brake holds the axis
  } else if (stop == Stop::power_off || !energised()) {
    switch_power(false);
  } else if (!reacting || (fault.reaction == Reaction::angle_lost && !stop_.shorts_windings())) {
    begin_stop(stop);  // shorted windings need no angle
  }
  homing_mode_.fault();
  identification_.abort();
  pending_ = {true, PowerState::fault};  // transition 14 follows in step_power
}

void Drive::collect_faults() {
  const CauseSet present = present_causes();
  faults_.warns = supervision_.warning();
  if (!present.any() && !faults_.warned.any()) return;
  bool gone = false;
  for (const FaultRow& fault : policy_.faults.rows) {
    const bool is_present = present.test(fault.cause);
    if (fault.reaction == Reaction::none) {
      faults_.warns |= is_present;
      gone |= !is_present && faults_.warned.test(fault.cause);
      const bool tell = is_present && !faults_.warned.test(fault.cause) && events_ != nullptr;
      faults_.warned.set(fault.cause, is_present);
      if (tell) events_->warning_raised(fault);
    } else if (is_present) {
      raise(fault.cause);
    }
  }
  if (gone && events_ != nullptr) events_->errors_gone(error_register());
}

CauseSet Drive::present_causes() const {
  CauseSet present = supervision_.present();
  present |= faults_.injected;
  present |= faults_.kept;
  if (!units_valid_) present.set(Cause::factor_group);
  if (current_offset_great_) present.set(Cause::current_sensor);
  if (axis_.velocity_clipped) present.set(Cause::velocity_clipped);
  if (axis_.position_change_clipped) present.set(Cause::position_change_clipped);
  if (buffers_records() && interpolated_position_.lost_record()) present.set(Cause::interpolation_overrun);
  return present;
}

// The bits of 1001h of all faults and warnings that are present.
std::uint8_t Drive::error_register() const {
  std::uint8_t bits = 0;
  for (const FaultRow& fault : policy_.faults.rows) {
    if (faults_.active.test(fault.cause) || faults_.warned.test(fault.cause)) bits |= fault.error_register;
  }
  return bits;
}

// Returns whether faults were present and all are reset.
bool Drive::reset_faults() {
  if (state_ != PowerState::fault) return false;
  const CauseSet present = present_causes();
  for (const FaultRow& fault : policy_.faults.rows) {
    if (!faults_.active.test(fault.cause)) continue;
    if (fault.reset == ResetRule::clear_multi_turn && faults_.multi_turn_cleared && !present.test(fault.cause))
      continue;
    if (fault.reset != ResetRule::when_cause_gone || present.test(fault.cause)) {
      if (policy_.faults.first_is_shown) show_fault(fault);  // the fault that prevents the reset
      return false;
    }
  }
  faults_.active.clear();
  faults_.shown = nullptr;
  axis_.objects.error_code = 0;
  axis_.raised = Cause::none;
  enter_state(PowerState::switch_on_disabled);
  if (events_ != nullptr) events_->errors_gone(error_register());
  return true;
}

void Drive::communication_lost(Cause cause) {
  if (policy_.communication.loss_is_always_fault) return raise(cause);
  switch (axis_.objects.abort_connection_option_code) {
    case 1:
      waiting_.waits = false;
      if (energised()) raise(cause);
      break;
    case 2: handle_command(Command::disable_voltage); break;
    case 3: handle_command(Command::quick_stop); break;
    default: break;
  }
}

// Calibrates the current sensors while no current flows; a sensor with a great offset has failed.
void Drive::calibrate_currents(const Feedback& feedback) {
  constexpr float greatest_share = 0.05F;  // of the peak current
  const bool open = !outputs_.pwm_enabled && !outputs_.short_circuit;
  const bool stands = axis_.shaft_stands && feedback.encoder_faults == 0;
  if (!current_offset_.cycle(feedback.phase_current_a, open, stands)) return;
  cascade_.set_current_offset(current_offset_.offset_a());
  if (!current_offset_.done()) return;
  const float greatest = greatest_share * axis_.configuration.motor.peak_current_a;
  current_offset_great_ = std::any_of(current_offset_.offset_a().begin(), current_offset_.offset_a().end(),
                                      [greatest](float offset_a) { return std::abs(offset_a) > greatest; });
}

}  // namespace servodrome::drive
