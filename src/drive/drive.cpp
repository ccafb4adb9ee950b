#include "drive/drive.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "drive/with_mode.hpp"

namespace servodrome::drive {

namespace {

constexpr std::uint32_t precharge_ms = 300;  // longest time for the DC link to reach its voltage

}  // namespace

Drive::Drive(const Policy& policy, Objects& objects, std::size_t objects_base)
    : policy_(policy),
      transitions_(policy.power.transitions),
      objects_base_(objects_base),
      axis_{.objects = objects, .policy = policy},
      touch_probe_(TouchProbeCapability{}) {
  for (const StatusBit& row : policy.status.bits) shown_sources_ |= bit(row.source);
  set_mode(Mode::none);
  set_rates();
  axis_.loops = &cascade_.state();
}

void Drive::configure(const Configuration& configuration) {
  for (std::size_t i = 0; i < max_inputs; ++i) {
    // Changing the simulation of an input changes its level without an edge on its wire.
    const InputFunction& before = axis_.configuration.inputs[i];
    const InputFunction& now = configuration.inputs[i];
    const bool high = (inputs_.wires >> i & 1u) != 0;
    if (now.signal == Signal::none || now.forced == before.forced || now.signal != before.signal) continue;
    if (now.active(high) != before.active(high)) note_edge({now.signal, now.active(high), axis_.encoder_position});
  }
  // The filter starts with the present levels if this configuration switches it on.
  if (axis_.configuration.input_filter_cycles == 0) inputs_.filter.reset(inputs_.wires);
  axis_.configuration = configuration;
  choose_comparators();
  if (!energised()) set_rates();
  cascade_.configure(configuration.motor, configuration.gains, rates_);
  supervision_.configure(axis_);
  const float shown_ms = configuration.shown_velocity_ms;
  axis_.velocity_display.configure(shown_ms > 0.0F ? shown_ms : ShownVelocity::needed_ms(configuration.motor),
                                   configuration.shown_velocity_filter_ms, axis_.cycle_s);
  if (touch_probe_.capability() != configuration.touch_probe) {
    touch_probe_ = TouchProbe(configuration.touch_probe);
    load_touch_probe();
  }
  touch_probe_.set_deviation_supervision(configuration.motor.counts_per_revolution,
                                         configuration.monitors.index_deviation);
  inputs_.evaluated = ~inputs_.wires;  // forces a new evaluation, because the functions of the wires may have changed
  set_units();
}

Rates Drive::wanted_rates() const {
  const Rates& own = axis_.configuration.rates;
  return {own.velocity_loop_ticks != 0 ? own.velocity_loop_ticks : policy_.loops.velocity_ticks,
          own.position_loop_ticks != 0 ? own.position_loop_ticks : policy_.loops.position_ticks};
}

void Drive::set_rates() {
  rates_ = wanted_rates();
  axis_.cycle_s = rates_.position_loop_ticks * tick_seconds;
  axis_.cycles_per_ms = 1e-3 / axis_.cycle_s;
}

bool Drive::set_units() {
  greatest_of_rpm_.reset();
  axis_.units.counts_per_revolution = axis_.configuration.motor.counts_per_revolution;
  units_valid_ = policy_.units == nullptr || policy_.units(axis_.objects, axis_.configuration.motor, axis_.units);
  return units_valid_;
}

void Drive::objects_loaded() {
  set_units();
  load_touch_probe();
}

void Drive::command(std::uint16_t controlword) {
  axis_.objects.controlword = controlword;
  handle_controlword(controlword_, controlword);
}

void Drive::clear_controlword_bits(std::uint16_t bits) {
  const std::uint16_t before = axis_.controlword;
  for (std::uint16_t* word : {&axis_.objects.controlword, &controlword_, &axis_.controlword, &waiting_.word_before}) {
    *word = static_cast<std::uint16_t>(*word & ~unsigned{bits});
  }
  if (state_ == PowerState::operation_enabled && before != axis_.controlword) {
    with_mode(*this, [&](auto& mode) { mode.controlword(axis_, before, axis_.controlword); });
  }
}

void Drive::set_touch_probe_function(std::uint16_t function) {
  axis_.objects.touch_probe_function = function;
  touch_probe_.write_function(function);
}

void Drive::load_touch_probe() {
  touch_probe_.write_function(axis_.objects.touch_probe_function);
  for (std::size_t i = 0; i < axis_.objects.touch_probe_source.size(); ++i) {
    touch_probe_.write_source(i, axis_.objects.touch_probe_source[i]);
  }
}

void Drive::power_on(const Feedback& feedback) {
  axis_.homed = false;
  axis_.offset =
      policy_.single_turn_encoder ? static_cast<Counts>(feedback.single_turn_counts) - feedback.position_counts : 0;
  if (axis_.configuration.encoder_begins_at_zero) axis_.offset = -feedback.position_counts;
  dc_link_.forget_connection();
  stage_.forget_brake();
  outputs_ = {};
  edge_count_ = 0;
  measured_.tripped = 0;
  terminal_outputs_ = 0;
  inputs_.limit_positions = {};
  inputs_.wires = inputs_.changed = feedback.inputs;
  inputs_.filter.reset(inputs_.wires);
  axis_.encoder_position = measured_.position_of_ms = feedback.position_counts;
  measured_.single_turn_counts = feedback.single_turn_counts;
  axis_.counts_per_ms = 0;
  supervision_.reset();
  faults_.kept.clear();
  cascade_ = {};
  look_at_ = 0;
  cascade_.forget_motion();
  current_offset_ = {};
  current_offset_great_ = false;
  axis_.velocity_display.forget();
  axis_.greatest_velocity = 0.0;
  restart();
}

void Drive::displaced(const Feedback& feedback) {
  cascade_.forget_motion();
  axis_.velocity_display.forget();
  inputs_.wires = feedback.inputs;
  axis_.encoder_position = measured_.position_of_ms = feedback.position_counts;
  measured_.single_turn_counts = feedback.single_turn_counts;
  axis_.generator.reset(axis_.position());
}

void Drive::restart() {
  state_ = PowerState::not_ready_to_switch_on;
  waiting_.waits = false;
  set_mode(Mode::none);
  pending_ = {};
  stop_.end();
  halted_ = zero_speed_ = false;
  stage_.reset();
  const bool erroneous = faults_.active.any() || faults_.warned.any();
  faults_.active.clear();
  faults_.warned.clear();
  if (erroneous && events_ != nullptr) events_->errors_gone(0);
  faults_.shown = nullptr;
  axis_.commanded.reset();
  axis_.objects.error_code = 0;
  axis_.raised = Cause::none;
  axis_.demand = {};
  axis_.synchronised = axis_.new_set_point = axis_.following_error = axis_.limited = false;
  no_mode_ = {};
  profile_position_ = {};
  velocity_mode_ = {};
  profile_velocity_ = {};
  immediate_velocity_ = {};
  profile_torque_ = {};
  homing_mode_ = {};
  interpolated_position_ = {};
  synchronous_interpolation_ = {};
  cyclic_sync_position_ = {};
  cyclic_sync_velocity_ = {};
  cyclic_sync_torque_ = {};
  identification_.abort();
  cascade_.disable();
  touch_probe_ = TouchProbe(axis_.configuration.touch_probe);
  configure(axis_.configuration);
  objects_loaded();
  controlword_ = axis_.objects.controlword;
  axis_.controlword = static_cast<std::uint16_t>(controlword_ & ~controlword::fault_reset);
  axis_.generator.reset(axis_.position());
}

void Drive::synchronise() {
  axis_.synchronised = true;
  axis_.sync_age = static_cast<double>(cascade_.ticks_to_position_loop()) / rates_.position_loop_ticks;
}

bool Drive::tick(const Feedback& feedback, Actuation& actuation) {
  if (feedback.edge_count != 0) capture_edges(feedback);
  const bool cycle_due = cascade_.position_loop_due();
  if ((measured_.tripped | feedback.hardware_faults) != 0) [[unlikely]]
    trip(feedback.hardware_faults, cycle_due, actuation);
  if (cascade_.ticks() == look_at_) [[unlikely]]
    look_for_open_phase(feedback, actuation);
  if (cycle_due) {
    cycle(feedback);
    actuation = outputs_;
  }
  cascade_.tick(feedback, actuation);
  return cycle_due;
}

[[gnu::noinline]] void Drive::look_for_open_phase(const Feedback& feedback, const Actuation& actuation) {
  look_at_ += supervision_.open_phase().next_look();
  if (!outputs_.pwm_enabled) return;
  supervision_.open_phase().look({.current_a = cascade_.current_of(feedback),
                                  .voltage_v = actuation.phase_voltage_v,
                                  .angle = cascade_.electrical_angle(),
                                  .position = feedback.position_counts,
                                  .dc_link_v = feedback.dc_link_v,
                                  .field_turns = axis_.demand.loop != Loop::locked});
}

void Drive::cycle(const Feedback& feedback) {
  if (!energised() && rates_ != wanted_rates()) configure(axis_.configuration);  // changed while the motor had power
  axis_.encoder_position = feedback.position_counts;
  measured_.single_turn_counts = feedback.single_turn_counts;
  if (++measured_.cycles_of_ms >= axis_.cycles(1)) {
    measured_.cycles_of_ms = 0;
    axis_.counts_per_ms = axis_.encoder_position - measured_.position_of_ms;
    measured_.position_of_ms = axis_.encoder_position;
  }
  axis_.velocity_display.update(axis_.encoder_position);
  dc_link_.sample(feedback.dc_link_v);
  measured_.winding_temperature_c = feedback.winding_temperature_c;
  measured_.power_stage_temperature_c = feedback.power_stage_temperature_c;
  watch_standstill();
  if (!current_offset_.done()) calibrate_currents(feedback);
  update_inputs(feedback);
  axis_.edges = std::span(edges_.data(), edge_count_);

  supervision_.cycle(axis_, feedback,
                     {.hardware_faults = measured_.tripped,
                      .energised = energised() && !stop_.shorts_windings(),
                      .dc_link_expected = dc_link_.connected_cycles() > axis_.cycles(precharge_ms),
                      .brake_closed = axis_.configuration.has_brake() &&
                                      stage_.closed_cycles() > axis_.cycles(axis_.configuration.brake_engage_ms + 100),
                      .homing = mode_ == Mode::homing && (homes() || axis_.generator.standing()),
                      .profiled = state_ == PowerState::operation_enabled &&
                                  (mode_ == Mode::profile_position || mode_ == Mode::profile_velocity),
                      .pressing = presses(),
                      .loop = axis_.demand.loop});
  collect_faults();
  axis_.velocity_clipped = axis_.position_change_clipped = false;                 // the steps below set them again
  if (faults_.active.test(Cause::following_error)) axis_.following_error = true;  // shown until the fault is reset
  if (state_ == PowerState::not_ready_to_switch_on) {
    enter_state(PowerState::switch_on_disabled);
    handle_command(command_of(axis_.controlword));  // a command given while the drive was not ready
  }
  change_mode();
  if (!holds_greatest_velocity()) update_greatest_velocity();
  step_dc_link();
  if (axis_.active(Signal::quick_stop) && state_ == PowerState::operation_enabled) handle_command(Command::quick_stop);
  step_power();
  const bool smooths = axis_.configuration.smooths() || smoothing_.lags();
  const std::optional<std::int64_t> stood_at = smooths ? standing_demand() : std::nullopt;
  if (stage_.is_on() || (stage_.brake_opens() && stop_.active())) {
    run_mode();
  } else if (zero_speed_) {
    axis_.generator.start_from(axis_.position(), 0.0);
    axis_.follow_generator(Loop::velocity);
  } else if (energised()) {  // the brake opens or closes
    come_to_rest_at_brake();
  } else {
    axis_.generator.reset(axis_.position());  // no demand for a motor without power
  }
  if (axis_.raised != Cause::none) {
    // Errors that the mode finds in its set-points take effect in this cycle, before the loops get them.
    raise(axis_.raised);
    axis_.raised = Cause::none;
  }
  if (smooths) {
    smooth_demand(moved_demand_ ? std::nullopt : stood_at);
  } else {
    smoothing_.leave();
  }
  hold_by_current();
  // The analysis is for an axis at rest only: it excites the axis, and the gains may be soft meanwhile.
  if (in_motion() || held_by_current_) cascade_.stop_analysis();
  set_limits();
  write_actuation();
  note_demand_source();
  // With shorted windings the loops have no effect on the motor. They are off, so that no integral winds up.
  const bool controlled = energised() && !stop_.shorts_windings();
  if (controlled != cascade_.enabled()) controlled ? cascade_.enable(feedback) : cascade_.disable();
  if (axis_.configuration.knows_load()) [[unlikely]] {
    LoopDemand demand = axis_.demand;
    demand.torque += known_load();
    cascade_.set_demand(demand);
  } else {
    cascade_.set_demand(axis_.demand);
  }
  axis_.objects.statusword = statusword();
  axis_.synchronised = false;
  axis_.demand.from_shaft = false;
  moved_demand_ = false;
  edge_count_ = 0;
  measured_.tripped = 0;
}

void Drive::set_mode(Mode mode) {
  mode_ = mode;
  shown_bits_ = {};
  const std::uint32_t its_bit = mode_bit(mode);
  for (const StatusBit& row : policy_.status.bits) {
    if (its_bit != 0 && (row.modes & its_bit) == 0) continue;
    std::uint16_t& bits = shown_bits_[static_cast<std::size_t>(row.source)];
    bits = static_cast<std::uint16_t>(bits | 1u << row.bit);
  }
}

void Drive::enter_mode(Mode wanted) {
  const bool running = state_ == PowerState::operation_enabled && !pending_.active;
  if (running) take_over_shaft();
  homing_mode_.abort();
  homing_mode_.forget_error(axis_);
  identification_.abort();
  set_mode(wanted);
  waiting_.word_before = axis_.controlword;  // an earlier edge of bit 4 was for the previous mode
  if (!running) return;
  // The new mode continues from the present motion of the axis. A velocity demand has no position, so the generator is
  // set ahead of the position of the shaft.
  if (axis_.demand.loop == Loop::velocity) axis_.lead_shaft(axis_.generator.velocity());
  stop_.end();
  halted_ = false;
  axis_.limited = false;
  axis_.stopped_at = 0;
  with_mode(*this, [&](auto& mode) { mode.enter(axis_); });
}

void Drive::run_mode() {
  if (state_ == PowerState::operation_enabled && !pending_.active && !stop_.at_limit()) {
    const bool halt =
        (axis_.controlword & controlword::halt) != 0 && (policy_.modes.without_halt & mode_bit(mode_)) == 0;
    if (halt && !halted_) {
      halted_ = true;
      end_identification();
      with_mode(*this, [&](auto& mode) { mode.halt(axis_); });
      const std::int16_t code = axis_.objects.halt_option_code;
      begin_stop(stop_of(code != 0 ? code : policy_.power.halt_code_of_zero));
    } else if (!halt && halted_) {
      take_over_shaft();
      stop_.end();
      halted_ = false;
      if (stop_.loop != Loop::position) axis_.lead_shaft(axis_.generator.velocity());
      if (axis_.generator.finished()) axis_.come_to_rest(RampShape::linear);  // unless the mode resumes a motion
      with_mode(*this, [&](auto& mode) { mode.resume(axis_); });
    }
  }
  if (stop_.active()) {
    keep_stop_within_limits();
    end_halted_motion_at_limit_switch();
    step_stop();
    with_mode(*this, [&](auto& mode) {
      if constexpr (requires { mode.observe(axis_); }) mode.observe(axis_);
    });
    if (stop_.at_limit() && stop_finished()) stop_.end_at_limit(halted_);
    return;
  }
  slow_down_with_shaft();
  keep_near_shaft();
  const Counts before = axis_.generator.nearest_position();
  const bool identifying = identification_.running();
  with_mode(*this, [&](auto& mode) { mode.step(axis_); });
  limit_switches(before);
  if (identifying && !identification_.running()) stop_after_identification();
}

bool Drive::identify_inertia(const InertiaIdentification::Request& request) {
  return runs_mode() && !in_motion() && identification_.begin(axis_, request);
}

void Drive::stop_identification() {
  if (!identification_.running()) return;
  identification_.abort();
  stop_after_identification();
}

// The mode takes the axis over in its present state.
void Drive::end_identification() {
  if (!identification_.running()) return;
  identification_.abort();
  return_to_mode();
}

// As after a halt: no target of before moves the axis, and no edge of a controlword that came meanwhile.
void Drive::return_to_mode() {
  axis_.take_over_actual();
  axis_.come_to_rest(RampShape::linear);
  profile_position_.interrupt(axis_, 0);
  interpolated_position_.clear_buffer();
  with_mode(*this, [&](auto& mode) {
    mode.resume(axis_);
    mode.controlword(axis_, axis_.controlword, axis_.controlword);
  });
}

// The mode continues from the present state of the axis. If the identification was not completed, the axis is stopped
// first.
void Drive::stop_after_identification() {
  return_to_mode();
  if (identification_.outcome() == InertiaIdentification::Outcome::done) return;
  begin_stop(Stop::quick_stop_ramp);
  stop_.set_at_limit();
}

void Drive::write_actuation() {
  outputs_.pwm_enabled = energised() && !stop_.shorts_windings();
  outputs_.short_circuit = energised() && stop_.shorts_windings();
  const Configuration& configuration = axis_.configuration;
  bool released = brake_released();
  if (policy_.terminals.brake_output_bit >= 0) {  // the bus may control the brake directly
    const std::uint32_t bit = 1u << static_cast<unsigned>(policy_.terminals.brake_output_bit);
    if ((axis_.objects.output_mask & bit) != 0) released = (axis_.objects.physical_outputs & bit) == 0;
  }
  outputs_.brake_released = released != configuration.brake_inverted || configuration.brake_forced;
  stage_.note_brake(outputs_.brake_released);
  outputs_.dc_link_connected =
      policy_.power.dc_link == DcLink::always || waiting_.waits || energised() || state_ == PowerState::switched_on;
  dc_link_.note_connected(outputs_.dc_link_connected);
  outputs_.chopper_on = supervision_.chopper();
  outputs_.outputs =
      (axis_.objects.physical_outputs & axis_.objects.output_mask) >> policy_.terminals.first_output_bit &
      ((1u << policy_.terminals.output_count) - 1u) & configuration.remote_outputs;
  outputs_.outputs |= terminal_outputs_;
}

std::uint16_t Drive::statusword() const {
  std::uint16_t word = policy_.power.state_bits[static_cast<std::size_t>(state_)];
  const bool powered =
      outputs_.dc_link_connected && dc_link_.voltage_v() > axis_.configuration.monitors.under_voltage_v;
  if (powered) word |= statusword::voltage_enabled;
  if (faults_.warns || faults_.device_warns || (policy_.status.faults_show_as_warning && faults_.active.any()))
    word |= statusword::warning;
  for (std::uint32_t shown = status_sources(); shown != 0; shown &= shown - 1) {
    word |= shown_bits_[static_cast<std::size_t>(std::countr_zero(shown))];
  }
  return word;
}

// The active sources of the upper bits of the statusword, as bit(StatusSource).
std::uint32_t Drive::status_sources() const {
  std::uint32_t shown = 0;
  const auto show = [&shown](StatusSource source, bool present) { shown |= present ? bit(source) : 0; };
  show(StatusSource::remote, policy_.status.remote && axis_.configuration.remote);
  const CascadeState& loops = cascade_.state();
  show(StatusSource::internal_limit, energised() && (axis_.limited || loops.torque_limited || loops.velocity_limited));
  show(StatusSource::internal_limit,
       policy_.status.limit_switches_show_as_limit &&
           (axis_.active(Signal::negative_limit) || axis_.active(Signal::positive_limit)));
  if (shows(StatusSource::position_limit)) show(StatusSource::position_limit, axis_.held_by_position_limit());
  show(StatusSource::following_error, axis_.following_error);
  show(StatusSource::commutation_found,
       state_ != PowerState::not_ready_to_switch_on && !faults_.active.test(Cause::encoder_connection));
  show(StatusSource::home_found, axis_.homed);
  if (shows(StatusSource::software_limit)) show(StatusSource::software_limit, axis_.beyond_software_limits());
  const bool working = state_ == PowerState::operation_enabled || state_ == PowerState::quick_stop_active;
  const bool failed = state_ == PowerState::fault_reaction_active || state_ == PowerState::fault;
  if (!working && !failed) return shown;
  const bool enabled = state_ == PowerState::operation_enabled;
  show(StatusSource::halt, enabled && (axis_.controlword & controlword::halt) != 0);
  show(StatusSource::in_motion, enabled && in_motion());
  std::uint16_t bits = with_mode(*this, [&](const auto& mode) { return mode.status(axis_); });
  if (failed) {
    bits &= statusword::mode_bit_13;  // the error bit stays until the fault is reset
  } else if (stop_.active()) {
    const bool cyclic = is_cyclic_synchronous(mode_);
    if (cyclic) bits &= static_cast<std::uint16_t>(~statusword::mode_bit_12);  // the target is ignored
    bits &= static_cast<std::uint16_t>(~statusword::target_reached);
    const bool shows = !cyclic || policy_.status.cyclic_modes_show_reached;
    if (shows && stop_finished() && !stop_.at_limit()) bits |= statusword::target_reached;
  } else if (!stage_.is_on()) {  // the brake opens or closes, the mode does not run
    bits &= static_cast<std::uint16_t>(~statusword::target_reached);
    if (is_cyclic_synchronous(mode_) || mode_ == Mode::interpolated_position) {
      bits &= static_cast<std::uint16_t>(~statusword::mode_bit_12);
    }
  }
  show(StatusSource::target_reached, (bits & statusword::target_reached) != 0);
  show(StatusSource::mode_bit_12, (bits & statusword::mode_bit_12) != 0);
  show(StatusSource::mode_bit_13, (bits & statusword::mode_bit_13) != 0);
  return shown;
}

}  // namespace servodrome::drive
