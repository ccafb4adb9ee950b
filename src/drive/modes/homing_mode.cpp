#include "drive/modes/homing_mode.hpp"

#include <utility>

#include "drive/power/power_state.hpp"

namespace servodrome::drive {

namespace {

// A shaft that turns faster than this moves. Ripple and the end of a rebound from a hard stop are slower.
constexpr double moving_share = 0.1;  // of 6099h:01
constexpr double moving_rpm = 10.0;
// A shaft that stays within this distance presses against a hard stop. A loaded axis that starts slowly moves farther,
// even with a short stall time.
constexpr double stall_turns = 0.0001;
constexpr Counts least_stall_counts = 2;
// The shaft may still be this far behind a standing demand, or sag by this much under a load, when a leg begins.
constexpr double slack_turns = 0.05;

Cause cause_of(HomingError error) {
  switch (error) {
    case HomingError::unsupported_method: return Cause::homing_method;
    case HomingError::wrong_limit:
    case HomingError::home_not_found: return Cause::homing_wrong_limit;
    case HomingError::timed_out: return Cause::homing_timeout;
    default: return Cause::homing_state;
  }
}

// Returns true if the switches that the method needs are assigned to inputs.
bool has_inputs_for(const Axis& axis, const Method& method) {
  const auto has = [&axis](Signal signal) {
    const InputMap& inputs = axis.configuration.inputs;
    return std::any_of(inputs.begin(), inputs.end(), [signal](const InputFunction& in) { return in.signal == signal; });
  };
  const bool reversed = axis.units.position_inverted;
  const auto limit = [reversed](Direction end) {
    return (end == Direction::negative) != reversed ? Signal::negative_limit : Signal::positive_limit;
  };
  for (const Direction end : {Direction::negative, Direction::positive}) {
    if (needs_limit_switch(method, end) && !has(limit(end))) return false;
  }
  return !needs_home_switch(method) || has(Signal::home);
}

// Returns true if the ramp and the speeds that the method uses are set. The way back to home uses the slow speed.
bool can_run(const Method& method, const HomingConfig& config) {
  const bool retracts = config.retraction != 0;
  const bool returns = method.returns_to_latch || config.end != HomingEnd::as_method;
  if (config.fast <= 0.0 && uses_speed(method, HomingSpeed::fast, retracts)) return false;
  if (config.slow <= 0.0 && (returns || uses_speed(method, HomingSpeed::slow, retracts))) return false;
  return config.acceleration > 0.0;
}

}  // namespace

void HomingMode::enter(Axis& axis) {
  abort();
  given_up_ = pressed_ = false;
  forget_error(axis);
  standing_ = true;
  ramp_ = axis.objects.homing_acceleration;
  axis.come_to_rest(RampShape::linear);
}

void HomingMode::controlword(Axis& axis, std::uint16_t before, std::uint16_t now) {
  const bool was = (before & controlword::mode_bit_4) != 0;
  const bool is = (now & controlword::mode_bit_4) != 0;
  if (is && !was) {
    start_requested_ = true;
    given_up_ = false;
    attained_ = false;
    forget_error(axis);
    standing_ = false;
  }
  if (!is && was && (active_ || start_requested_)) {
    abort();
    given_up_ = true;
  }
}

// Within 6080h and, if the product has them for homing, 60C5h and 60C6h.
MotionLimits HomingMode::motion(const Axis& axis, double velocity) const {
  const bool bounded = axis.policy.ramps.greatest_limit_homing || ramp_ == 0;
  const double acceleration = axis.ramp(ramp_, bounded ? axis.objects.max_acceleration : 0);
  const double deceleration = axis.ramp(ramp_, bounded ? axis.objects.max_deceleration : 0);
  return {std::min(velocity, axis.max_velocity(false)), acceleration, deceleration > 0.0 ? deceleration : acceleration,
          1.0};
}

HomingInputs HomingMode::inputs(const Axis& axis) const {
  const double moving = std::max(moving_share * axis.objects.homing_speed_switch * axis.units.velocity,
                                 axis.rpm_to_counts_per_s(moving_rpm));
  const auto error = static_cast<double>(axis.generator.nearest_position() - axis.position());
  const bool lags = std::abs(error) > axis.lag(axis.generator.velocity());
  return {.signals = axis.signals,
          .edges = axis.edges,
          .standing = axis.generator.standing(),
          .torque = axis.torque(),
          .position = axis.encoder_position,
          .velocity = axis.velocity(),
          .moves = std::abs(axis.velocity()) > moving,
          .ahead = !lags         ? 0
                   : error > 0.0 ? 1
                                 : -1};
}

void HomingMode::fail(Axis& axis, Cause cause) {
  error_ = true;
  active_ = attained_ = false;
  if (axis.policy.homing.errors_are_faults) axis.raise(cause);
  shown_code_ = error_code(axis, cause);
  if (shown_code_ != 0) axis.objects.error_code = shown_code_;
}

std::uint16_t HomingMode::error_code(const Axis& axis, Cause cause) const {
  const HomingErrorCodes& codes = axis.policy.homing.error_codes;
  if (cause != Cause::homing_wrong_limit) return codes.not_possible;
  return homing_.limit_ahead() == Signal::positive_limit ? codes.positive_limit : codes.negative_limit;
}

void HomingMode::forget_error(Axis& axis) {
  error_ = false;
  if (shown_code_ != 0 && axis.objects.error_code == shown_code_) axis.objects.error_code = 0;
  shown_code_ = 0;
}

void HomingMode::start(Axis& axis) {
  const Objects& objects = axis.objects;
  const Method* method = find_method(axis.policy.homing.methods, objects.homing_method);
  if (method == nullptr || (uses_index(*method) && !axis.configuration.index_available)) {
    return fail(axis, Cause::homing_method);
  }
  if (method->idle) return;
  if (axis.policy.homing.needs_its_inputs && !has_inputs_for(axis, *method)) return fail(axis, Cause::homing_method);
  HomingConfig config{
      .fast = std::min(objects.homing_speed_switch * axis.units.velocity, axis.max_velocity(false)),
      .slow = std::min(objects.homing_speed_zero * axis.units.velocity, axis.max_velocity(false)),
      .acceleration = axis.ramp(objects.homing_acceleration, objects.max_acceleration),
      .stall_torque = axis.configuration.homing_stall_torque,
      .stall_cycles = std::max<std::uint32_t>(1, axis.cycles(axis.configuration.homing_stall_ms)),
      .stall_window =
          std::max<Counts>(least_stall_counts, std::llround(stall_turns * axis.units.counts_per_revolution)),
      .retraction = axis.configuration.homing_retraction,
      .timeout_cycles = axis.cycles(axis.configuration.homing_timeout_ms),
      .end = method->offset_applies ? axis.configuration.homing_end : HomingEnd::as_method,
      .end_offset = -axis.units.to_counts(std::int64_t{axis.policy.homing.offset_sign} * objects.home_offset),
      .slack = std::llround(slack_turns * axis.units.counts_per_revolution),
      .blind_window = axis.configuration.homing_blind_window,
      .index_width = axis.configuration.motor.index_width_counts,
      .reversed = axis.units.position_inverted};
  if (method->leg_count > 0 && !can_run(*method, config)) return fail(axis, Cause::profile_value_zero);
  ramp_ = objects.homing_acceleration;
  offset_applies_ = method->offset_applies;
  active_ = true;
  limits_ = motion(axis, axis.max_velocity(false));
  if (axis.policy.homing.counts_at_rest) axis.homed = false;
  last_ = {};
  homing_.start(*method, config, inputs(axis));
}

// Resumes the interrupted motion, unless homing was aborted meanwhile.
void HomingMode::resume(Axis& axis) {
  halted_ = false;
  if (active_) carry_out(axis, last_);
}

// Edges during the ramp of a halt count for the leg as well.
void HomingMode::observe(Axis& axis) {
  if (!halted_ || !active_) return;
  const bool had_latch = homing_.latched();
  const HomingCommand command = homing_.step_halted(inputs(axis));
  if (command.kind != HomingCommand::Kind::keep) last_ = command;
  take_results(axis, had_latch);
}

void HomingMode::carry_out(Axis& axis, const HomingCommand& command) {
  switch (command.kind) {
    case HomingCommand::Kind::keep: return;
    case HomingCommand::Kind::velocity:
      axis.generator.run_at(command.velocity, motion(axis, std::abs(command.velocity)), RampShape::linear);
      break;
    case HomingCommand::Kind::position:
      axis.generator.move_to(command.position + axis.offset, 0.0, motion(axis, std::abs(command.velocity)),
                             RampShape::linear);
      break;
    case HomingCommand::Kind::stop: stop(axis); break;
    case HomingCommand::Kind::hold: axis.generator.reset(command.position + axis.offset); break;
  }
  last_ = command;
}

// Without a ramp of its own, homing stops by that of the profile.
void HomingMode::stop(Axis& axis, double least_deceleration) const {
  MotionLimits limits = motion(axis, axis.max_velocity(false));
  limits.deceleration = std::max(limits.deceleration, least_deceleration);
  if (limits.deceleration <= 0.0) return axis.come_to_rest(RampShape::linear);
  axis.generator.come_to_rest(limits, RampShape::linear);
}

// Stops from the actual position of the shaft: while the shaft presses against a stop, it does not follow the demand.
void HomingMode::give_up(Axis& axis) {
  if (std::exchange(pressed_, false)) {
    axis.take_over_actual();
  } else if (!axis.follows_demand()) {
    axis.take_over_lagging();
  }
  // If a load drives the axis back, the axis stops with at least the deceleration of the quick stop.
  stop(axis, homing_.error() == HomingError::driven_back ? axis.quick_stop_ramp() : 0.0);
}

void HomingMode::step(Axis& axis) {
  if (given_up_) {  // here, so that a halt or another stop keeps its own ramp
    given_up_ = false;
    give_up(axis);
  }
  if (start_requested_) {
    start_requested_ = false;
    start(axis);
  }
  if (active_) {
    const bool had_latch = homing_.latched();
    const bool waited = homing_.awaits_rest();
    pressed_ = homing_.pressing() != 0;
    // 6080h, 60C5h or 60C6h was changed in motion.
    if (const MotionLimits limits = motion(axis, axis.max_velocity(false)); limits != limits_) {
      limits_ = limits;
      carry_out(axis, last_);
    }
    carry_out(axis, homing_.step(inputs(axis)));
    if (homing_.error() != HomingError::none) give_up(axis);
    take_results(axis, had_latch);
    if (waited && !homing_.awaits_rest()) axis.limited = false;
  }
  if (!active_ || homing_.awaits_rest()) axis.rest_within_limits();
  axis.generator.step(axis.cycle_s);
  standing_ = !start_requested_ && !active_ && axis.generator.standing();
  axis.follow_generator(loop);
}

void HomingMode::take_results(Axis& axis, bool had_latch) {
  if (homing_.latched() && !had_latch) {
    // Home is at the latch: the position there becomes the home offset with the product's sign.
    const std::int64_t at_home =
        offset_applies_ ? std::int64_t{axis.policy.homing.offset_sign} * axis.objects.home_offset : 0;
    const Counts home = axis.units.to_counts(at_home);
    const Counts offset = home - homing_.latch();
    axis.generator.shift(offset - axis.offset);
    axis.offset = offset;
    if (!axis.policy.homing.counts_at_rest) axis.homed = attained_ = true;
  }
  if (homing_.finished() && axis.policy.homing.counts_at_rest) axis.homed = attained_ = true;
  if (homing_.error() != HomingError::none) fail(axis, cause_of(homing_.error()));
  if (homing_.finished()) active_ = false;
}

std::uint16_t HomingMode::status(const Axis& axis) const {
  std::uint16_t bits = 0;
  if (standing_ && (attained_ || !axis.policy.homing.reached_means_home)) bits |= statusword::target_reached;
  if (attained_) bits |= statusword::mode_bit_12;
  if (error_) bits |= statusword::mode_bit_13;
  return bits;
}

}  // namespace servodrome::drive
