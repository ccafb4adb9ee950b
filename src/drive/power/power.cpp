#include "drive/with_mode.hpp"

// The effects of the power state machine's transitions on motor and brake.
namespace servodrome::drive {

namespace {

constexpr double standing_rpm = 5.0;  // the shaft stands if it is slower (for StopRun::standing_ms)

// Returns true if an option code is in a set of them (OptionCodes).
bool has(std::uint32_t codes, std::int16_t code) {
  return code >= 0 && code < 32 && (codes >> static_cast<unsigned>(code) & 1u) != 0;
}

}  // namespace

void Drive::handle_controlword(std::uint16_t before, std::uint16_t now) {
  controlword_ = now;
  // A mode that was written before this controlword must already be in force for it, not only from the next cycle on.
  change_mode();
  if ((now & controlword::fault_reset) != 0) {
    waiting_.waits = false;  // a new word cancels the earlier command
    // A word with bit 7 resets faults and commands nothing: in the table of commands bit 7 is 0 (CiA 402-2 table 9).
    // Halt is not in that table, so it acts beside any other bits.
    const bool resets = (before & controlword::fault_reset) == 0 && reset_faults();
    if (!resets || !policy_.power.reset_word_is_a_command) {
      axis_.controlword |= now & controlword::halt;
      return;
    }
  }
  const std::uint16_t commanded_before = axis_.controlword;
  axis_.controlword = now;
  waiting_.word_before = (waiting_.waits ? waiting_.word_before : commanded_before) & now;
  handle_command(command_of(now));
  if (state_ == PowerState::operation_enabled) {
    with_mode(*this, [&](auto& mode) { mode.controlword(axis_, commanded_before, now); });
  }
}

bool Drive::accepts(const Transition& transition) const {
  if (transition.from != state_) return false;
  switch (transition.number) {
    case 3: return transition.command != Command::enable_operation || policy_.power.direct_enable;
    case 16:  // not during a stop that ends in Switch on disabled
      return policy_.power.transition_16 && !pending_.active && !axis_.active(Signal::quick_stop) &&
             has(policy_.power.option_codes.quick_stop_continues, axis_.objects.quick_stop_option_code);
    case release_quick_stop: return !pending_.active;
    case 4:
    case 6: return !quick_stops_in_switched_on();
    default: return true;
  }
}

void Drive::handle_command(Command command) {
  if (command != Command::switch_on && command != Command::enable_operation) waiting_.waits = false;
  const bool disables_voltage = pending_.active && pending_.to == PowerState::switch_on_disabled;
  const bool stays = (state_ == PowerState::operation_enabled && command == Command::enable_operation) ||
                     (state_ == PowerState::switched_on && command == Command::switch_on);
  if (stays && pending_.active && !disables_voltage) {
    // The command asks for the present state while a stop would end it: the mode continues from the present motion.
    enter_state(state_);
    return;
  }
  const Transition* transition = transitions_.find(state_, command);
  if (transition == nullptr || !accepts(*transition)) return;
  // The transition is under way already. Only disable voltage does not wait for the end of a ramp.
  if (pending_.active && pending_.to == transition->to && command != Command::disable_voltage) return;
  switch (transition->number) {
    case 3:
      waiting_.waits = !dc_link_charged();
      if (waiting_.waits) break;
      enter_state(PowerState::switched_on);
      if (command == Command::enable_operation) enter_state(PowerState::operation_enabled);
      break;
    case 5: leave_operation(stop_of_option_code(axis_.objects.disable_operation_option_code), transition->to); break;
    case 8: leave_operation(stop_of_option_code(axis_.objects.shutdown_option_code), transition->to); break;
    case 9:
    case 12: leave_operation(Stop::power_off, transition->to); break;
    case 11: {
      const std::int16_t code = axis_.objects.quick_stop_option_code;
      state_ = PowerState::quick_stop_active;
      leave_operation(stop_of(code), PowerState::switch_on_disabled);
      if (has(policy_.power.option_codes.quick_stop_stays, code)) {
        pending_.active = false;
        if (stage_.brake_closes()) switch_power(true);  // an earlier command has begun to close the brake
      }
      break;
    }
    case 16: enter_state(PowerState::operation_enabled); break;
    case release_quick_stop:
      if (energised() && stop_.active()) {
        pending_ = {true, transition->to};  // after the stop
      } else {
        leave_operation(Stop::power_off, transition->to);
      }
      break;
    default:
      if (energised() && !has_power_in(transition->to)) {  // products that energise the motor in Switched on
        leave_operation(stop_in_switched_on(command), transition->to);
      } else {
        enter_state(transition->to);
      }
  }
}

// For a drive that does not monitor its DC link, any voltage is enough.
bool Drive::dc_link_charged() const {
  const FaultRow* fault = row(Cause::under_voltage);
  const bool watched =
      fault != nullptr && fault->reaction != Reaction::none && !axis_.configuration.ignored.test(Cause::under_voltage);
  return !watched || dc_link_.charged(axis_.configuration.monitors.under_voltage_v, axis_.cycles_per_ms);
}

// Makes transition 3 when the DC link has its voltage. The present controlword then decides whether transition 4
// follows. A mode bit that was set meanwhile, e.g. for a set-point, counts as an edge now.
void Drive::step_dc_link() {
  if (!waiting_.waits || !dc_link_charged()) return;
  enter_state(PowerState::switched_on);
  handle_command(command_of(axis_.controlword));
  if (state_ == PowerState::operation_enabled) {
    with_mode(*this, [&](auto& mode) { mode.controlword(axis_, waiting_.word_before, axis_.controlword); });
  }
}

// For 605Ah and 605Dh.
Stop Drive::stop_of(std::int16_t code) const {
  const std::int16_t at_once = policy_.power.option_codes.at_once_from;
  return at_once != 0 && code >= at_once ? Stop::current_limit : stop_of_option_code(code);
}

// A motor with power in Switched on may still turn, for example after transition 5 without a ramp. The commands then
// stop it as they do in Operation enabled.
Stop Drive::stop_in_switched_on(Command command) const {
  if (command == Command::quick_stop) return stop_of(axis_.objects.quick_stop_option_code);
  if (command == Command::shutdown) return stop_of_option_code(axis_.objects.shutdown_option_code);
  return Stop::power_off;
}

bool Drive::has_power_in(PowerState state) const {
  return state == PowerState::operation_enabled ||
         (state == PowerState::switched_on && policy_.power.energised_in_switched_on);
}

void Drive::leave_operation(Stop stop, PowerState to) {
  if (stop == Stop::power_off && has_power_in(to)) {
    enter_state(to);  // the axis is held in this state
  } else if (stop == Stop::power_off && hold_for_brake()) {
    pending_ = {true, to};
  } else if (stop == Stop::power_off || !energised()) {
    switch_power(false);
    enter_state(to);
  } else {
    begin_stop(stop);
    pending_ = {true, to};
  }
  homing_mode_.abort();
}

// Commands zero speed at once, without a ramp, while the brake closes. Returns false if the product does not do so, or
// if the brake has nothing to hold.
bool Drive::hold_for_brake() {
  if (!policy_.power.brake_engages_before_off || !axis_.configuration.has_brake() || !energised()) return false;
  if (too_fast_for_brake()) return false;
  if (zero_speed_ && stage_.brake_closes()) return true;  // the master repeats the command in every cycle
  stop_.end();
  zero_speed_ = true;
  close_brake();
  return true;
}

bool Drive::too_fast_for_brake() const {
  const auto rpm = static_cast<double>(axis_.configuration.brake_speed_rpm);
  return rpm > 0.0 && std::abs(axis_.velocity()) >= axis_.rpm_to_counts_per_s(rpm);
}

void Drive::close_brake() { stage_.close_brake(axis_.cycles(axis_.configuration.brake_engage_ms)); }

void Drive::enter_state(PowerState to) {
  const bool power = has_power_in(to);
  if (power && energised()) take_over_shaft();
  state_ = to;
  waiting_.waits = false;
  pending_ = {};
  stop_.end();
  halted_ = false;
  axis_.limited = false;
  axis_.stopped_at = 0;
  zero_speed_ = false;
  homing_mode_.abort();
  identification_.abort();
  if (power != energised()) {
    switch_power(power);
    // If the axis is at standstill by the criterion of a stop, it holds its present position, even if it drifts slowly.
    if (power) axis_.shaft_stands ? axis_.generator.reset(axis_.position()) : axis_.take_over_actual();
  } else if (stage_.brake_closes()) {
    switch_power(true);  // enabled again while the brake closes
    axis_.take_over_actual();
  } else if (power && axis_.demand.loop != Loop::position) {
    axis_.take_over_lagging();
  }
  if (to == PowerState::operation_enabled) {
    with_mode(*this, [&](auto& mode) { mode.enter(axis_); });
  } else if (power) {
    no_mode_.enter(axis_);
  }
}

void Drive::switch_power(bool on) {
  zero_speed_ = false;
  if (on) {
    stage_.switch_on(axis_.cycles(axis_.configuration.brake_release_ms));
  } else {
    if (brake_released() && too_fast_for_brake()) stage_.let_coast(axis_.cycles(axis_.configuration.brake_wait_ms));
    stage_.switch_off();
    axis_.demand = {};
  }
}

// Lets the next motion begin from the actual motion of the shaft if the shaft does not follow its demand: under torque
// control, in a stop without a ramp, while homing presses against a hard stop, or after a demand that no motor can
// follow, such as a cyclic set-point that jumps. `apart`: the shaft is known not to follow.
void Drive::take_over_shaft(bool apart) {
  const Loop loop = axis_.demand.loop;
  if (loop == Loop::off) return;
  if (loop == Loop::locked) return axis_.take_over_slipped();
  apart |= (stop_.active() && stop_.without_ramp()) || (mode_ == Mode::homing && homing_mode_.has_pressed());
  const bool follows = !apart && axis_.follows_demand();
  if (follows && !smoothing_.lags(loop)) return;
  homing_mode_.shaft_taken_over();
  if (follows) {  // continues from the smoothed demand, which lags behind the generator
    leave_smoothing();
  } else {
    apart ? axis_.take_over_actual() : axis_.take_over_lagging();
    axis_.demand.from_shaft = true;
  }
  moved_demand_ = true;
  smoothing_.leave();
}

// Continues from the output of the filter, which lags behind the generator.
void Drive::leave_smoothing() {
  const Counts place =
      smoothing_.is_position() ? smoothing_.position_counts() + axis_.offset : axis_.generator.nearest_position();
  axis_.generator.start_from(place, static_cast<double>(smoothing_.velocity()));
  smoothing_.leave();
}

// If the axis cannot brake as fast as a ramp to rest that has no target, it overtakes the demand. The demand then
// follows the shaft, so that the position loop does not pull the axis back. If the shaft turns back or stands, the
// demand stays where it is and holds the axis, which may oscillate about it.
void Drive::keep_near_shaft() {
  Generator& generator = axis_.generator;
  if (generator.rest_direction() == 0.0 || axis_.demand.loop != Loop::position) return;
  const bool turns_back = axis_.velocity() * generator.rest_direction() < 0.0;
  if (generator.standing() && (turns_back || axis_.shaft_stands)) generator.hold_rest();
  if (moved_demand_) return;  // the following error belongs to an earlier demand
  const auto error = static_cast<double>(cascade_.state().following_error_counts);
  const double most = axis_.lag(axis_.velocity());
  if (std::abs(error) <= most || error * generator.rest_direction() >= 0.0) return;
  if (smoothing_.lags(Loop::position)) {
    leave_smoothing();
    generator.rest_again();
  }
  generator.shift(static_cast<Counts>(std::copysign(most, error) - error));
  smoothing_.leave();
}

// If a jam, for example, slows the shaft down far below the speed of a ramp to rest, the ramp continues from the speed
// of the shaft, because such a ramp must not accelerate the shaft. This does not apply to a shaft that oscillates about
// a slow demand or has turned back.
void Drive::slow_down_with_shaft() {
  if (axis_.generator.rest_direction() == 0.0) return;
  constexpr double least_share = 0.5;      // of the ramp's speed
  constexpr double slow_ramp_share = 0.1;  // of the motor's greatest speed
  constexpr double unsure_rpm = 30.0;
  constexpr std::uint32_t least_ms = 2;
  const double wanted = axis_.generator.velocity();
  const double shaft = axis_.velocity() * std::copysign(1.0, wanted);
  const bool fast =
      std::abs(wanted) >
      slow_ramp_share * axis_.rpm_to_counts_per_s(static_cast<double>(axis_.configuration.motor.max_speed_rpm));
  const bool slower = shaft < least_share * std::abs(wanted) && shaft > -axis_.rpm_to_counts_per_s(unsure_rpm);
  if (!axis_.lasts(fast && slower, outrun_, least_ms)) return;
  outrun_.reset();
  axis_.take_over_lagging(std::copysign(std::max(0.0, shaft), wanted));
  axis_.demand.from_shaft = true;
  moved_demand_ = true;
  axis_.generator.rest_again();
}

void Drive::begin_stop(Stop stop, bool apart) {
  end_identification();
  cascade_.stop_analysis();
  take_over_shaft(apart);
  stop_.begin(stop);
  outrun_.reset();
  begin_ramp();
  axis_.follow_generator(stop_.loop);  // takes effect in this cycle
}

// The deceleration of a stop's ramp, counts/s^2; 0: the stop has no ramp.
double Drive::deceleration_of(Stop stop) const {
  double deceleration = 0.0;
  if (stop == Stop::slow_down_ramp) {
    deceleration = with_mode(*this, [&](const auto& mode) { return mode.deceleration(axis_); });
  } else if (stop == Stop::quick_stop_ramp) {
    deceleration = quick_stop_deceleration();
  }
  const std::uint32_t greatest = axis_.objects.max_deceleration;
  return greatest != 0 ? std::min(deceleration, greatest * axis_.units.acceleration) : deceleration;
}

// Begins the ramp of the stop, or its replacement, from the generator's state.
void Drive::begin_ramp() {
  const Objects& objects = axis_.objects;
  const double deceleration = deceleration_of(stop_.kind());
  RampShape shape = RampShape::linear;
  if (stop_.kind() == Stop::slow_down_ramp) {
    shape = axis_.demand.loop == Loop::velocity ? axis_.velocity_stop_shape() : axis_.shape();
  }
  const double jerk = objects.profile_jerk[0] * axis_.units.jerk;
  if (jerk <= 0.0 && shape == RampShape::jerk_limited) shape = RampShape::linear;
  // Without a deceleration the axis brakes at the current limit instead of by a ramp.
  if (stop_.kind() != Stop::voltage_limit && deceleration <= 0.0) stop_.change_kind(Stop::current_limit);
  const Loop loop = axis_.demand.loop;  // off: enabled since the last cycle
  stop_.loop = loop == Loop::torque ? Loop::velocity : loop == Loop::off ? Loop::position : loop;
  if (stop_.without_ramp()) {
    stop_.loop = Loop::velocity;
    axis_.generator.start_from(axis_.position(), 0.0);
    return;
  }
  stop_.deceleration = deceleration;
  // For a shaft above the speed limit the ramp begins at its actual speed, so the limit must not clip it.
  axis_.greatest_velocity = std::max(axis_.greatest_velocity, std::abs(axis_.generator.velocity()));
  axis_.generator.come_to_rest({axis_.max_velocity(false), deceleration, deceleration, std::max(1.0, jerk)}, shape);
}

double Drive::quick_stop_deceleration() const {
  return mode_ == Mode::velocity ? velocity_mode_.quick_stop_deceleration(axis_) : axis_.quick_stop_ramp();
}

// By its slope or its shape, the slow-down ramp of a halt or of the end of operation may need more distance than there
// is before a limit. A linear ramp then replaces it, with the deceleration of the quick stop if that is steeper. The
// ramp of a fault (605Eh) does not change.
void Drive::keep_stop_within_limits() {
  if (homes() || stop_.kind() != Stop::slow_down_ramp || state_ == PowerState::fault_reaction_active) return;
  const double quick = deceleration_of(Stop::quick_stop_ramp);
  const bool at_switch = meets_limit_switch();
  const double steepest = std::max(quick, stop_.deceleration);
  const bool at_limit = axis_.has_to_brake_for_limit(steepest);
  if (!at_switch && !at_limit) return;
  if (!policy_.status.limit_switches_show_as_limit) axis_.limited = true;
  if (quick > stop_.deceleration) {
    stop_.change_kind(Stop::quick_stop_ramp);
    begin_ramp();
  } else if (at_limit) {
    axis_.generator.come_to_rest({axis_.max_velocity(false), steepest, steepest, 1.0}, RampShape::linear);
  }
}

// Returns true if the axis moves towards an active limit switch during a stop.
bool Drive::meets_limit_switch() const {
  if (!axis_.at_limit_switch()) return false;
  const bool slow = std::abs(axis_.velocity()) < axis_.rpm_to_counts_per_s(standing_rpm);
  return axis_.runs_into_limit_switch(!stop_.without_ramp() ? axis_.generator.velocity()
                                      : slow                ? 0.0
                                                            : axis_.velocity());
}

// A limit switch that the axis meets during a halt ends the motion, as it does without the halt. (If limit switches
// cause a fault, the fault follows at the end of the halt if the switch is still active.)
void Drive::end_halted_motion_at_limit_switch() {
  if (!halted_ || stop_.at_limit() || pending_.active || homes()) return;
  if (policy_.limits.switches != LimitSwitches::stop || !meets_limit_switch()) return;
  const double moves = stop_.without_ramp() ? axis_.velocity() : axis_.generator.velocity();
  stop_.set_at_limit();
  with_mode(*this, [&](auto& mode) { mode.interrupt(axis_, moves < 0.0 ? -1 : 1); });
}

void Drive::watch_standstill() {
  const bool slow = std::abs(axis_.velocity()) < axis_.rpm_to_counts_per_s(standing_rpm);
  axis_.shaft_stands = axis_.lasts(slow, standstill_, StopRun::standing_ms);
}

void Drive::step_stop() {
  if (stop_.without_ramp()) {
    const CascadeState& loops = cascade_.state();
    const float square = loops.current_d_a * loops.current_d_a + loops.current_q_a * loops.current_q_a;
    axis_.generator.start_from(axis_.position(), 0.0);
    stop_.step_without_ramp(axis_, stop_.shorts_windings() ? square : 0.0F);
  } else {
    slow_down_with_shaft();
    axis_.generator.step(axis_.cycle_s);
    keep_near_shaft();
    stop_.step_ramp(axis_);
  }
  axis_.follow_generator(stop_.loop);
}

// While the brake opens or closes the axis is held, and no motion begins. An axis that was enabled in motion comes to
// rest.
void Drive::come_to_rest_at_brake() {
  Generator& generator = axis_.generator;
  if (!generator.standing()) {
    if (generator.rest_direction() == 0.0) axis_.come_to_rest(RampShape::linear, axis_.quick_stop_ramp());
    slow_down_with_shaft();
    generator.step(axis_.cycle_s);
  }
  keep_near_shaft();
  axis_.follow_generator(Loop::position);
}

// Steps brake and power stage, and completes stops that lead to another state.
void Drive::step_power() {
  stage_.step(too_fast_for_brake());
  if (!pending_.active) return;
  if (stage_.is_on() && (stop_finished() || stop_.slows_no_more())) {
    if (has_power_in(pending_.to)) return enter_state(pending_.to);
    // The position loop holds the present position, because the demand of a velocity loop may have another position.
    if (axis_.demand.loop != Loop::position) axis_.generator.reset(axis_.position());
    close_brake();
  }
  // An axis at rest needs no stop: the brake has not opened, or opens while the loops hold the axis.
  if (stage_.brake_opens() && !has_power_in(pending_.to) && axis_.shaft_stands) close_brake();
  if (stage_.step_closing()) switch_power(false);
  if (!energised()) enter_state(pending_.to);
}

}  // namespace servodrome::drive
