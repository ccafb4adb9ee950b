#include "products/jmc_ec/panel_control.hpp"

#include <cmath>
#include <cstring>
#include <numbers>

namespace servodrome::products::jmc_ec {

namespace {

using dictionary::AbortCode;

constexpr double pi = std::numbers::pi;
constexpr std::uint16_t standard = 1;  // P01-02
constexpr std::uint16_t positioning = 2;

// Corner frequency of a filter from its time constant in 0.01 ms; 0: off.
float corner_hz(std::uint16_t time_constant) {
  return time_constant == 0 ? 0.0F : static_cast<float>(1.0 / (2.0 * pi * time_constant * 1e-5));
}
float tenths_of_percent(int value) { return static_cast<float>(value) * 0.001F; }

std::uint16_t rounded(double value) { return static_cast<std::uint16_t>(std::clamp(std::round(value), 1.0, 65535.0)); }

constexpr double inertia_unit = 1e-6;  // 0.01 kg cm^2

}  // namespace

void adjust_gains(Panel& panel) {
  if (panel.adjustment_mode != standard && panel.adjustment_mode != positioning) return;
  const GainSetValues& level = rigidity_levels[panel.rigidity_level & 31U];
  panel.position_gain = {level.position_gain_1, level.position_gain_2};
  panel.velocity_gain = {level.velocity_gain_1, level.velocity_gain_2};
  panel.integral_time = {level.integral_time_1, level.integral_time_2};
  panel.torque_filter = level.torque_filter;
  if (panel.adjustment_mode != positioning) return;
  panel.velocity_forward = 300;        // 30.0 % (ch. 8.2.2, P01-02)
  panel.velocity_forward_filter = 50;  // 0.50 ms (ch. 8.2.2, P01-02)
}

void PanelControl::factory_values(Panel& panel, const drive::MotorData& motor) {
  panel.rated_speed_rpm = rounded(static_cast<double>(motor.rated_speed_rpm));
  panel.rated_torque = rounded(100.0 * static_cast<double>(motor.rated_torque_nm));
  panel.rated_current = rounded(100.0 * static_cast<double>(motor.rated_current_a) / std::numbers::sqrt2);
  panel.rotor_inertia = rounded(static_cast<double>(motor.inertia_kgm2) / inertia_unit);
  panel.pole_pairs = motor.pole_pairs;
  panel.encoder_lines = static_cast<std::uint16_t>(motor.counts_per_revolution / 4);
}

void PanelControl::power_on(Panel& panel, const drive::MotorData& motor) {
  factory_values(factory_, motor);
  adjust_gains(panel);
  active_ = panel;
  switching_ = {};
  in_position_ = false;
  levels_ = 0;
}

drive::MotorData PanelControl::motor(const drive::MotorData& rating) const {
  drive::MotorData motor = rating;
  const Panel& now = active_;
  const Panel& then = factory_;
  if (now.motor_code != 0) return rating;  // only 0 makes P00-01 to 17 available (ch. 8.2.1, P00-00)
  if (now.rated_speed_rpm != then.rated_speed_rpm) motor.rated_speed_rpm = now.rated_speed_rpm;
  if (now.rated_torque != then.rated_torque) motor.rated_torque_nm = 0.01F * now.rated_torque;
  if (now.rated_current != then.rated_current) {
    motor.rated_current_a = static_cast<float>(0.01 * std::numbers::sqrt2 * now.rated_current);
  }
  if (now.rotor_inertia != then.rotor_inertia) {
    motor.inertia_kgm2 = static_cast<float>(inertia_unit * now.rotor_inertia);
  }
  if (now.pole_pairs != then.pole_pairs) motor.pole_pairs = now.pole_pairs;
  if (now.encoder_lines != then.encoder_lines && now.encoder_lines != 0) {
    motor.counts_per_revolution = 4U * now.encoder_lines;
  }
  return motor;
}

// P02-10 is the frequency at which the gain of the loop crosses 1 with the inertia of P00-04 and P01-04 (ch. 7: P01-04
// is set first). The integral acts with its time constant.
drive::Gains PanelControl::gains(const Panel& panel, const drive::MotorData& motor) const {
  const std::size_t set = switching_.set();
  const double velocity_rad_s = 2.0 * pi * 0.1 * panel.velocity_gain[set];
  const double kp =
      velocity_rad_s * static_cast<double>(motor.inertia_kgm2) / static_cast<double>(motor.torque_constant_nm_per_a);
  const double position_gain =
      panel.position_gain[0] +
      switching_.blend() * (panel.position_gain[1] - static_cast<double>(panel.position_gain[0]));
  drive::Gains gains;
  gains.current_bandwidth_hz = current_bandwidth_hz;
  gains.velocity_kp = static_cast<float>(kp);
  gains.velocity_ki = static_cast<float>(kp / (1e-4 * panel.integral_time[set]));
  gains.velocity_setpoint_weight = tenths_of_percent(panel.pseudo_derivative[set]);
  gains.position_kp = static_cast<float>(0.1 * position_gain);
  gains.velocity_feed_forward = tenths_of_percent(panel.velocity_forward);
  gains.velocity_feed_forward_filter_hz = corner_hz(panel.velocity_forward_filter);
  gains.acceleration_feed_forward = 0.01F * panel.torque_forward;
  gains.acceleration_feed_forward_filter_hz = corner_hz(panel.torque_forward_filter);
  gains.velocity_filter_hz = corner_hz(panel.velocity_filter);
  gains.torque_filter_hz = corner_hz(panel.torque_filter);
  gains.disturbance_share = tenths_of_percent(panel.disturbance_gain);
  gains.disturbance_filter_hz = corner_hz(panel.disturbance_filter);
  return gains;
}

void PanelControl::configure(const Panel& panel, drive::Configuration& configuration) const {
  drive::MotorData& motor = configuration.motor;
  motor.inertia_kgm2 *= static_cast<float>(1.0 + 0.01 * panel.inertia_ratio);
  configuration.gains = gains(panel, motor);
  configuration.shown_velocity_filter_ms = 0.01F * panel.velocity_filter;  // P08-19 smooths 606Ch and d08 as well
  const auto counts_per_s = [&motor](int rpm) {
    return static_cast<float>(rpm) / 60.0F * static_cast<float>(motor.counts_per_revolution);
  };
  configuration.brake_release_ms = configuration.brake_engage_ms = panel.brake_delay_ms;
  configuration.brake_speed_rpm = panel.brake_speed_rpm;
  configuration.brake_wait_ms = panel.brake_wait_ms;
  configuration.weight_torque = tenths_of_percent(panel.torque_added);
  configuration.friction_torque_positive = tenths_of_percent(panel.torque_forward_motion);
  configuration.friction_torque_negative = tenths_of_percent(panel.torque_reverse_motion);
  configuration.position_lag_ms = 0.1F * panel.position_smoothing;
  configuration.homing_timeout_ms = 1000U * panel.homing_timeout_s;
  configuration.monitors.over_speed_by_object = false;  // P04-05 alone (Table 65, ch. 8.2.5)
  configuration.monitors.over_speed_rpm = panel.over_speed_rpm;
  configuration.monitors.over_voltage_v = over_voltage_v(configuration.monitors.over_voltage_v);
  configuration.velocity_limit_positive = counts_per_s(panel.forward_speed_rpm);
  configuration.velocity_limit_negative = counts_per_s(-panel.reverse_speed_rpm);
  configuration.torque_limit_positive = tenths_of_percent(panel.forward_torque);
  configuration.torque_limit_negative = tenths_of_percent(panel.reverse_torque);
}

AbortCode PanelControl::check(const dictionary::Entry& entry, const drive::Drive& drive) {
  const bool refused = set_while_stopped(parameter_of(entry)) && drive.energised();
  return refused ? AbortCode::device_state : AbortCode::none;
}

void PanelControl::written(Panel& panel) { adjust_gains(panel); }

bool PanelControl::power_cycle_needed(const Panel& panel) const {
  for (const dictionary::Entry& entry : panel_section) {
    if (entry.sub == 0 || !acts_from_power_on(parameter_of(entry))) continue;
    const auto* now = reinterpret_cast<const std::byte*>(&panel) + entry.offset;
    const auto* then = reinterpret_cast<const std::byte*>(&active_) + entry.offset;
    if (std::memcmp(now, then, dictionary::size_of(entry.type)) != 0) return true;
  }
  return false;
}

// P03-05 (ch. 8.2.4): the condition is the deviation alone, or the deviation after the end of the command or of the
// smoothed command.
bool PanelControl::reached(const Panel& panel, const drive::Drive& drive) const {
  if (!drive.energised() || drive.axis().demand.loop != drive::Loop::position) return false;
  if (std::abs(drive.loops().following_error_counts) >= panel.in_position_window) return false;
  return panel.in_position_criterion == 0 ||
         (!drive.in_motion() && (panel.in_position_criterion == 1 || drive.demand_smoothed()));
}

void PanelControl::cycle(const Panel& panel, drive::Drive& drive) {
  in_position_ = reached(panel, drive);
  const bool fault =
      drive.state() == drive::PowerState::fault || drive.state() == drive::PowerState::fault_reaction_active;
  const std::uint32_t active = (fault ? alarm_output : 0) | (in_position_ ? in_position_output : 0);
  const std::uint32_t inverted =
      (active_.alarm_level == 0 ? alarm_output : 0) | (active_.in_position_level == 0 ? in_position_output : 0);
  levels_ = active ^ inverted;
  drive.set_outputs(levels_);

  const auto mode = static_cast<SwitchingMode>(panel.switching_mode);
  if (mode == SwitchingMode::first && switching_.set() == 0 && switching_.blend() == 0.0) return;
  const drive::Axis& axis = drive.axis();
  const drive::CascadeState& loops = drive.loops();
  const double counts = axis.units.counts_per_revolution;
  const double level_of_speed = 60.0 / counts * speed_level_of_rpm;
  const bool position_loop = axis.demand.loop == drive::Loop::position;
  const bool changed = switching_.update(
      {.mode = mode,
       .level = static_cast<double>(panel.switching_level),
       .hysteresis = static_cast<double>(panel.switching_hysteresis),
       .delay_cycles = static_cast<std::uint32_t>(0.1 * panel.switching_delay * axis.cycles_per_ms + 0.5),
       .blend_cycles = static_cast<std::uint32_t>(0.1 * panel.position_gain_time * axis.cycles_per_ms + 0.5)},
      {.torque_command = std::abs(static_cast<double>(loops.torque_reference)) * torque_level_of_rated,
       .speed_command = static_cast<double>(loops.velocity_reference_counts_per_s) * level_of_speed,
       .position_deviation =
           std::abs(static_cast<double>(loops.following_error_counts)) / counts * position_level_of_turn,
       .actual_speed = std::abs(axis.velocity()) * level_of_speed,
       .position_command = position_loop && (drive.in_motion() || !drive.demand_smoothed()),
       .positioned = in_position_});
  if (changed) drive.set_gains(gains(panel, drive.configuration().motor));
}

}  // namespace servodrome::products::jmc_ec
