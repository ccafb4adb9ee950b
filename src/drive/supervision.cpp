#include "drive/supervision.hpp"

namespace servodrome::drive {

namespace {

struct FlagCause {
  std::uint32_t flag;
  Cause cause;
};

constexpr std::uint32_t flag(EncoderFault fault) { return static_cast<std::uint32_t>(fault); }
constexpr std::uint32_t flag(HardwareFault fault) { return static_cast<std::uint32_t>(fault); }

constexpr auto encoder_causes = std::to_array<FlagCause>({
    {flag(EncoderFault::connection_lost), Cause::encoder_connection},
    {flag(EncoderFault::crc), Cause::encoder_crc},
    {flag(EncoderFault::delimiter), Cause::encoder_delimiter},
    {flag(EncoderFault::multi_turn), Cause::encoder_multi_turn},
    {flag(EncoderFault::count), Cause::encoder_count},
    {flag(EncoderFault::count_overflow), Cause::encoder_count_overflow},
    {flag(EncoderFault::hall_wiring), Cause::hall_wiring},
    {flag(EncoderFault::hall_state), Cause::hall_state},
});

constexpr auto hardware_causes = std::to_array<FlagCause>({
    {flag(HardwareFault::overcurrent_u), Cause::overcurrent_u},
    {flag(HardwareFault::overcurrent_v), Cause::overcurrent_v},
    {flag(HardwareFault::overcurrent_w), Cause::overcurrent_w},
    {flag(HardwareFault::bus_overcurrent), Cause::bus_overcurrent},
    {flag(HardwareFault::short_circuit), Cause::short_circuit},
    {flag(HardwareFault::gate_supply_low), Cause::gate_supply},
    {flag(HardwareFault::internal), Cause::internal_hardware},
});

// Shorter dips of the voltage are ignored.
constexpr std::uint32_t under_voltage_ms = 5;

}  // namespace

std::uint32_t Supervision::comparator_of(Cause cause) {
  for (const FlagCause& row : hardware_causes) {
    if (row.cause == cause) return row.flag;
  }
  return 0;
}

void Supervision::configure(const Axis& axis) {
  const MotorData& motor = axis.configuration.motor;
  open_phase_.configure(motor);
  i2t_.configure(static_cast<double>(motor.rated_current_a), static_cast<double>(motor.peak_current_a),
                 static_cast<double>(axis.configuration.monitors.i2t_peak_time_s), axis.cycle_s);
  const Monitors& monitors = axis.configuration.monitors;
  if (monitors.stage_rated_current_a > 0.0F) {
    stage_i2t_.configure(static_cast<double>(monitors.stage_rated_current_a),
                         static_cast<double>(monitors.stage_peak_current_a),
                         static_cast<double>(monitors.i2t_peak_time_s), axis.cycle_s);
  }
}

void Supervision::cycle(Axis& axis, const Feedback& feedback, const Situation& situation) {
  present_.clear();
  warning_ = false;
  if (encoder_cycles_ > 0) --encoder_cycles_;
  if (feedback.encoder_faults != 0) {
    encoder_cycles_ = axis.cycles(encoder_return_ms);
    for (const FlagCause& row : encoder_causes) {
      if ((feedback.encoder_faults & row.flag) == 0) continue;
      present_.set(row.cause == Cause::encoder_connection ? axis.configuration.encoder_loss : row.cause);
    }
  }
  if (situation.hardware_faults != 0) {
    for (const FlagCause& row : hardware_causes) {
      if ((situation.hardware_faults & row.flag) != 0) present_.set(row.cause);
    }
  }
  if (axis.active(Signal::external_fault)) present_.set(Cause::external);
  if (axis.active(Signal::motor_temperature)) present_.set(Cause::motor_contact);
  if (situation.energised && axis.active(Signal::enable_refused)) present_.set(Cause::enable_refused);
  supply(axis, feedback, situation);
  temperatures(axis, feedback);
  limit_torque(axis, feedback);
  if (!situation.energised) open_phase_.reset();
  if (open_phase_.open()) present_.set(Cause::phase_loss);
  motion(axis, situation);
  const Monitors& monitors = axis.configuration.monitors;
  if (monitors.limit_switches || monitors.limit_switch_levels) limit_switches(axis, situation);
  last_signals_ = axis.signals;
}

// The fault occurs at the moment when the axis reaches the switch, and not as long as the switch is active. Otherwise
// the fault could be reset only after the axis was moved by hand. With `limit_switch_levels`, as for a warning, the
// level decides.
void Supervision::limit_switches(const Axis& axis, const Situation& situation) {
  const bool levels = axis.configuration.monitors.limit_switch_levels;
  if ((!axis.homed && !levels) || situation.homing) return;
  const std::uint32_t met = levels ? axis.signals : axis.signals & ~last_signals_;
  if ((met & bit(Signal::positive_limit)) != 0) present_.set(Cause::positive_limit);
  if ((met & bit(Signal::negative_limit)) != 0) present_.set(Cause::negative_limit);
}

void Supervision::supply(const Axis& axis, const Feedback& feedback, const Situation& situation) {
  const Monitors& monitors = axis.configuration.monitors;
  if (monitors.over_voltage_v > 0.0F && feedback.dc_link_v > monitors.over_voltage_v) present_.set(Cause::over_voltage);
  const bool low = situation.dc_link_expected && feedback.dc_link_v < monitors.under_voltage_v;
  if (axis.lasts(low, under_voltage_, under_voltage_ms)) present_.set(Cause::under_voltage);
  if (situation.dc_link_expected && feedback.dc_link_v < monitors.under_voltage_near_v) {
    present_.set(Cause::under_voltage_near);
  }
  if (feedback.dc_link_v > monitors.chopper_on_v) chopper_ = true;
  if (feedback.dc_link_v < monitors.chopper_off_v) chopper_ = false;
  const bool failed = !feedback.supply_present && situation.dc_link_expected;
  if (axis.lasts(failed, power_failure_, monitors.power_failure_ms)) present_.set(Cause::power_failure);
  if (monitors.brake_resistor_ms != 0 && axis.lasts(chopper_, brake_resistor_, monitors.brake_resistor_ms)) {
    present_.set(Cause::brake_resistor);
  }

  const float square =
      axis.loops->current_d_a * axis.loops->current_d_a + axis.loops->current_q_a * axis.loops->current_q_a;
  i2t_.update(square);
  const bool stage_watched = monitors.stage_rated_current_a > 0.0F;
  if (stage_watched) stage_i2t_.update(square);
  if (monitors.i2t) {
    if (i2t_.tripped()) present_.set(Cause::i2t);
    if (stage_watched && stage_i2t_.tripped()) present_.set(monitors.stage_apart ? Cause::stage_i2t : Cause::i2t);
    if (i2t_.utilisation_percent() > 90.0) warning_ = true;
    if (const auto near = static_cast<double>(monitors.overload_near_percent); near > 0.0) {
      if (i2t_.utilisation_percent() > near) present_.set(Cause::i2t_near);
      if (stage_watched && stage_i2t_.utilisation_percent() > near) present_.set(Cause::stage_i2t_near);
    }
  }
}

void Supervision::temperatures(const Axis& axis, const Feedback& feedback) {
  const Monitors& monitors = axis.configuration.monitors;
  const auto hot = [&](float value, float threshold, Cause cause) {
    if (threshold <= 0.0F) return;
    if (value > threshold) present_.set(cause);
    if (monitors.warning_margin_c > 0.0F && value > threshold - monitors.warning_margin_c) warning_ = true;
  };
  hot(feedback.power_stage_temperature_c, monitors.power_stage_hot_c, Cause::power_stage_hot);
  hot(feedback.winding_temperature_c, monitors.motor_hot_c, Cause::motor_hot);
  hot(feedback.encoder_temperature_c, monitors.encoder_hot_c, Cause::encoder_hot);
  hot(feedback.ambient_temperature_c, monitors.ambient_hot_c, Cause::ambient_hot);
  if (feedback.ambient_temperature_c < monitors.ambient_cold_c) present_.set(Cause::ambient_cold);
}

// The overload lowers the permitted current: from the peak current at 90 % to the rated current at 98 %, and above 98 %
// to less than the rated current. So the overload settles at 98 %. A temperature lowers the permitted torque to 0 over
// the last 10 K below its limit.
void Supervision::limit_torque(const Axis& axis, const Feedback& feedback) {
  const Monitors& monitors = axis.configuration.monitors;
  allowed_torque_ = std::numeric_limits<float>::max();
  if (!monitors.overload_limits_torque) return;
  constexpr double begins = 0.90;
  constexpr double ends = 0.98;
  constexpr float range_c = 10.0F;
  const auto by_overload = [](const I2t& overload, float rated_a, float peak_a) {
    const double room = std::min((ends - overload.heat) / (ends - begins), 1.0);
    return std::max(rated_a + (peak_a - rated_a) * static_cast<float>(room), 0.0F);
  };
  const auto by_temperature = [](float now_c, float limit_c) {
    return limit_c > 0.0F ? std::clamp((limit_c - now_c) / range_c, 0.0F, 1.0F) : 1.0F;
  };
  const MotorData& motor = axis.configuration.motor;
  float current_a = by_overload(i2t_, motor.rated_current_a, motor.peak_current_a);
  if (monitors.stage_rated_current_a > 0.0F) {
    current_a =
        std::min(current_a, by_overload(stage_i2t_, monitors.stage_rated_current_a, monitors.stage_peak_current_a));
  }
  const float cool = std::min(by_temperature(feedback.winding_temperature_c, monitors.motor_hot_c),
                              by_temperature(feedback.power_stage_temperature_c, monitors.power_stage_hot_c));
  allowed_torque_ = cool * current_a * motor.torque_constant_nm_per_a / motor.rated_torque_nm;
}

void Supervision::motion(Axis& axis, const Situation& situation) {
  const Objects& objects = axis.objects;
  const Monitors& monitors = axis.configuration.monitors;
  const MotorData& motor = axis.configuration.motor;

  float over_speed_rpm = monitors.over_speed_rpm > 0.0F ? monitors.over_speed_rpm : 1.2F * motor.max_speed_rpm;
  if (objects.max_motor_speed_rpm != 0 && monitors.over_speed_by_object) {
    over_speed_rpm = std::min(over_speed_rpm, 1.2F * static_cast<float>(objects.max_motor_speed_rpm));
  }
  // After the over-speed limit is lowered, the monitor uses the lower limit as soon as the shaft has stayed well below
  // it, ripple included, for longer than a swing through zero takes. Until then the previous limit applies.
  constexpr float well_below = 0.9F;
  constexpr std::uint32_t kept_ms = 100;
  const auto above = [&axis](float speed_rpm) {
    return std::abs(axis.velocity()) > axis.rpm_to_counts_per_s(static_cast<double>(speed_rpm));
  };
  const bool kept = axis.lasts(!above(well_below * over_speed_rpm), kept_below_, kept_ms);
  if (over_speed_rpm >= over_speed_rpm_ || kept) over_speed_rpm_ = over_speed_rpm;
  // When the connection of an encoder returns, the encoder shows the motion during the interruption as a speed.
  if (above(over_speed_rpm_) && encoder_cycles_ == 0) present_.set(Cause::over_speed);

  const Counts following = axis.loops->following_error_counts;
  const bool intended = following * situation.pressing > 0;
  const bool position_loop =
      situation.energised && !intended && (situation.loop == Loop::position || situation.loop == Loop::locked);
  std::uint32_t window = objects.following_error_window;
  if (window == 0) window = monitors.window_of_zero;
  bool outside = false;
  if (position_loop && window != 0xFFFFFFFF) {
    const std::int64_t error = axis.units.to_user(following);
    const std::int64_t magnitude = error < 0 ? -error : error;
    outside = magnitude > window;
    const float near = monitors.following_error_near;
    if (near > 0.0F && static_cast<float>(magnitude) > near * static_cast<float>(window)) {
      present_.set(Cause::following_error_near);
    }
  }
  axis.following_error = axis.lasts(outside, following_, objects.following_error_time_out_ms);
  if (axis.following_error) present_.set(Cause::following_error);

  if (monitors.acceleration_clipped && situation.profiled) {
    const bool clipped = (objects.max_acceleration != 0 && objects.profile_acceleration > objects.max_acceleration) ||
                         (objects.max_deceleration != 0 && objects.profile_deceleration > objects.max_deceleration);
    if (clipped) present_.set(Cause::acceleration_clipped);
  }
  const bool pushing = situation.energised && situation.pressing == 0 && axis.loops->torque_limited &&
                       (situation.loop == Loop::position || situation.loop == Loop::velocity);
  if (monitors.jammed_ms != 0 && axis.lasts(pushing && axis.counts_per_ms == 0, jammed_, monitors.jammed_ms)) {
    present_.set(Cause::jammed);
  }

  if (monitors.index_lost_revolutions != 0) {
    if (!situation.energised) index_position_ = axis.encoder_position;
    for (const SignalEdge& edge : axis.edges) {
      if (edge.signal == Signal::index) index_position_ = edge.position;
    }
    const Counts most = Counts{monitors.index_lost_revolutions} * motor.counts_per_revolution;
    if (std::abs(axis.encoder_position - index_position_) > most) present_.set(Cause::index_lost);
  }

  bool slow = false;
  if (situation.energised && situation.loop == Loop::velocity && monitors.velocity_error > 0.0) {
    slow = std::abs(axis.generator.velocity() - axis.velocity()) > monitors.velocity_error;
  }
  if (axis.lasts(slow, velocity_, monitors.velocity_error_ms)) present_.set(Cause::velocity_error);

  if (axis.policy.limits.target_beyond == OutOfLimits::fault && situation.energised && axis.software_limits_active()) {
    // The shaft may overshoot a target at the limit by some counts, so in the position loop the demand is checked.
    const bool demanded = situation.loop == Loop::position;
    const std::int64_t user = axis.to_user_position(demanded ? axis.generator.nearest_position() : axis.position());
    const double direction = axis.units.position_inverted ? -axis.generator.velocity() : axis.generator.velocity();
    const Axis::UserLimits limits = axis.software_limits();
    if ((user < limits.least && direction < 0.0) || (user > limits.greatest && direction > 0.0)) {
      present_.set(Cause::position_limit);
    }
  }

  // If the axis moves by more than a hundredth of a turn while the brake is closed, the brake does not hold it.
  if (situation.brake_closed) {
    if (!brake_was_closed_) brake_position_ = axis.encoder_position;
    const Counts slipped = std::abs(axis.encoder_position - brake_position_);
    if (slipped > std::max<Counts>(10, motor.counts_per_revolution / 100)) present_.set(Cause::brake);
  }
  brake_was_closed_ = situation.brake_closed;
}

}  // namespace servodrome::drive
