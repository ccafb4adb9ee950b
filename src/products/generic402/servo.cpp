#include "products/generic402/servo.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::products::generic402 {

namespace {

// 60A9h: SI unit velocity. Revolutions per minute or second instead of position units per second.
constexpr std::uint32_t unit_numerator_revolution = 0xB4;
constexpr std::uint32_t unit_denominator_minute = 0x47;
constexpr std::uint32_t unit_denominator_second = 0x03;

double velocity_unit(std::uint32_t si_unit, double counts_per_position_unit, double counts_per_shaft_revolution) {
  const auto exponent = static_cast<std::int8_t>(si_unit >> 24);
  const std::uint32_t numerator = si_unit >> 16 & 0xFF;
  const std::uint32_t denominator = si_unit >> 8 & 0xFF;
  if (numerator != unit_numerator_revolution) return counts_per_position_unit;
  const double prefix = std::pow(10.0, exponent);
  if (denominator == unit_denominator_minute) return prefix * counts_per_shaft_revolution / 60.0;
  if (denominator == unit_denominator_second) return prefix * counts_per_shaft_revolution;
  return counts_per_position_unit;
}

}  // namespace

bool units(const drive::Objects& objects, const drive::MotorData& motor, drive::Units& units) {
  using drive::Ratio;
  const Ratio encoder = Ratio::reduced(objects.position_encoder_increments, objects.position_encoder_motor_revolutions);
  const Ratio gear = Ratio::reduced(objects.gear_motor_revolutions, objects.gear_shaft_revolutions);
  const Ratio feed = Ratio::reduced(objects.feed, objects.feed_shaft_revolutions);
  if (!encoder.valid() || !gear.valid() || !feed.valid()) return false;
  // Counts per position unit = (608Fh) x (6091h) / (6092h).
  const Ratio shaft = encoder * gear;
  if (!shaft.valid()) return false;
  const Ratio position = shaft * feed.inverse();
  if (!position.valid()) return false;
  // Both factors convert to the user's units: velocity = (position units per second) x (6096h), acceleration =
  // (velocity units per second) x (6097h). The conversion here is the inverse.
  const auto inverse = [](std::uint32_t numerator, std::uint32_t divisor) {
    return static_cast<double>(divisor) / static_cast<double>(numerator);
  };
  units.position = position;
  units.velocity = velocity_unit(objects.si_unit_velocity, position.value(), shaft.value()) *
                   inverse(objects.velocity_factor_numerator, objects.velocity_factor_divisor);
  units.acceleration =
      units.velocity * inverse(objects.acceleration_factor_numerator, objects.acceleration_factor_divisor);
  units.jerk = units.acceleration;
  units.counts_per_revolution = motor.counts_per_revolution;
  units.position_inverted = (objects.polarity & 0x80) != 0;
  units.velocity_inverted = (objects.polarity & 0x40) != 0;
  return true;
}

void prepare(Manufacturer& own, drive::Objects& objects, const Settings& settings, dictionary::Area areas) {
  if (contains(areas, dictionary::Area::manufacturer)) {
    if (settings.node_id != 0) own.node_id = settings.node_id;
    if (settings.bit_rate != 0) own.bit_rate = settings.bit_rate;
    own.station = settings.serial.station;
    if (const auto& format = settings.serial.format) {
      own.serial_bit_rate = format->bit_rate;
      own.serial_parity = static_cast<std::uint8_t>(format->parity);
      own.serial_stop_bits = format->stop_bits;
    }
    own.brake_release_ms = settings.motor.brake_release_ms;
    own.brake_engage_ms = settings.motor.brake_engage_ms;
  }
  if (!contains(areas, dictionary::Area::profile)) return;
  // The nameplate and the encoder are those of the motor that is connected; one position unit is one increment.
  const drive::MotorData& motor = settings.motor;
  objects.position_encoder_increments = motor.counts_per_revolution;
  objects.feed = motor.counts_per_revolution;
  objects.motor_rated_current_ma =
      static_cast<std::uint32_t>(std::lround(static_cast<double>(motor.rated_current_a) / std::sqrt(2.0) * 1000.0));
  objects.motor_rated_torque_mnm =
      static_cast<std::uint32_t>(std::lround(static_cast<double>(motor.rated_torque_nm) * 1000.0));
}

drive::Configuration configuration(const Manufacturer& own, const drive::MotorData& motor) {
  drive::Configuration configuration;
  configuration.motor = motor;
  configuration.motor.inertia_kgm2 *= static_cast<float>(own.inertia_ratio) * 0.001F;
  drive::Gains gains =
      drive::default_gains(configuration.motor, {policy.loops.velocity_ticks, policy.loops.position_ticks},
                           {.current_hz = static_cast<float>(own.current_bandwidth_hz),
                            .velocity_hz = static_cast<float>(own.velocity_bandwidth_hz)});
  const auto override_with = [](float& gain, std::uint32_t value, float unit) {
    if (value != 0) gain = static_cast<float>(value) * unit;
  };
  override_with(gains.position_kp, own.position_kp, 0.01F);
  override_with(gains.velocity_kp, own.velocity_kp, 1e-6F);
  override_with(gains.velocity_ki, own.velocity_ki, 1e-6F);
  override_with(gains.velocity_filter_hz, own.velocity_filter_hz, 1.0F);
  override_with(gains.torque_filter_hz, own.torque_filter_hz, 1.0F);
  gains.velocity_feed_forward = static_cast<float>(own.velocity_feed_forward) * 0.001F;
  gains.acceleration_feed_forward = static_cast<float>(own.acceleration_feed_forward) * 0.001F;
  for (std::size_t i = 0; i < own.notch_frequency_hz.size(); ++i) {
    gains.notches[i] = {.frequency_hz = static_cast<float>(own.notch_frequency_hz[i]),
                        .width_hz = static_cast<float>(own.notch_width_hz[i]),
                        .depth = static_cast<float>(own.notch_depth[i]) * 0.001F};
  }
  gains.field_weakening_a = static_cast<float>(own.field_weakening_permille) * 0.001F * motor.rated_current_a;
  configuration.gains = gains;
  configuration.monitors.over_voltage_v = own.over_voltage_v;
  configuration.monitors.under_voltage_v = own.under_voltage_v;
  configuration.monitors.motor_hot_c = own.motor_hot_c;
  configuration.monitors.power_stage_hot_c = own.power_stage_hot_c;
  configuration.monitors.over_speed_rpm = static_cast<float>(own.over_speed_rpm);
  configuration.monitors.overload_limits_torque = own.overload_reaction != 0;
  for (std::size_t i = 0; i < own.input_function.size(); ++i) {
    configuration.inputs[i] = {static_cast<drive::Signal>(own.input_function[i]), (own.input_polarity >> i & 1) != 0};
  }
  configuration.touch_probe = drive::full_touch_probe;
  configuration.brake_release_ms = own.brake_release_ms;
  configuration.brake_engage_ms = own.brake_engage_ms;
  configuration.homing_stall_torque = static_cast<float>(own.stall_torque) * 0.001F;
  configuration.homing_stall_ms = own.stall_time_ms;
  configuration.homing_retraction = own.stall_retraction;
  configuration.homing_timeout_ms = own.homing_timeout_ms;
  return configuration;
}

SerialSetup serial_setup(const Manufacturer& own, const Settings& settings) {
  SerialSetup setup;
  setup.station = own.station != 0 ? own.station : own.node_id;
  if (setup.station > modbus::highest_station) setup.station = 0;  // the node-ID is missing until LSS assigns one
  setup.format = {.bit_rate = own.serial_bit_rate,
                  .parity = static_cast<modbus::Parity>(own.serial_parity),
                  .stop_bits = own.serial_stop_bits};
  setup.timing = modbus::at_least(settings.serial.silence, modbus::standard_timing(setup.format));
  return setup;
}

void set_interpolation_period(drive::Objects& objects, std::uint32_t period_ns) {
  std::uint32_t unit_ns = 1'000'000'000;
  for (std::int8_t power = 0; power >= -6; --power, unit_ns /= 10) {
    const std::uint32_t units = period_ns / unit_ns;
    if (units == 0 || units > 255 || units * unit_ns != period_ns) continue;
    objects.interpolation_time_period_value = static_cast<std::uint8_t>(units);
    objects.interpolation_time_index = power;
    return;
  }
}

std::uint16_t i2t_utilisation(const drive::Drive& drive) {
  return static_cast<std::uint16_t>(std::min(65535.0, std::round(drive.i2t_utilisation_percent())));
}

}  // namespace servodrome::products::generic402
