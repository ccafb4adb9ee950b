#include "products/ismc/ismc.hpp"

namespace servodrome::products {

namespace {

constexpr std::uint16_t i2t_enable = 1u << 1;  // of 2017h (ch. 5, 8900h)
constexpr std::uint32_t velocity_tracking_off = 0xFFFFFFFF;

// 10 and 100 kbit/s are not offered (Table 1-2, ch. 2.2).
constexpr auto ismc_bit_rates = std::to_array<std::int64_t>({1000000, 800000, 500000, 250000, 125000, 50000, 20000});

drive::Signal signal_of(std::uint8_t function) {
  switch (static_cast<ismc::InputFunction>(function)) {
    case ismc::InputFunction::negative_limit: return drive::Signal::negative_limit;
    case ismc::InputFunction::positive_limit: return drive::Signal::positive_limit;
    case ismc::InputFunction::home: return drive::Signal::home;
    case ismc::InputFunction::external_alarm: return drive::Signal::external_fault;
    case ismc::InputFunction::motor_temperature: return drive::Signal::motor_temperature;
    case ismc::InputFunction::none: break;
  }
  return drive::Signal::none;
}

}  // namespace

void Ismc::prepare(dictionary::Area areas) {
  objects().communication.serial_number = settings().serial_number;
  if (contains(areas, dictionary::Area::manufacturer)) {
    if (settings().node_id != 0) objects().manufacturer.node_id = settings().node_id;
    if (settings().bit_rate != 0) objects().manufacturer.bit_rate = settings().bit_rate;
  }
  objects().drive.positioning_option_code = 1;  // relative to the demand position (ch. 4.3.3, G16)
}

drive::Configuration Ismc::configuration() const {
  const ismc::Manufacturer& own = objects().manufacturer;
  drive::Configuration configuration;
  configuration.motor = settings().motor;
  const drive::MotorData& motor = configuration.motor;
  configuration.motor.peak_current_a = motor.rated_current_a * static_cast<float>(own.peak_current) * 0.001F;
  configuration.gains = drive::default_gains(motor, {policy.loops.velocity_ticks, policy.loops.position_ticks}, {});
  configuration.monitors.i2t = (own.protection_enable & i2t_enable) != 0;
  if (!configuration.monitors.i2t) configuration.ignored.set(drive::Cause::i2t);
  configuration.monitors.i2t_peak_time_s = static_cast<float>(own.peak_current_time_ms) * 0.001F;
  configuration.monitors.ambient_cold_c = static_cast<float>(own.minimum_ambient_c);
  configuration.monitors.motor_hot_c = 0.0F;  // off: an input watches the winding's contact (7124h)
  configuration.monitors.index_deviation = own.index_deviation_threshold;
  if (own.velocity_tracking_threshold != velocity_tracking_off) {
    configuration.monitors.velocity_error = own.velocity_tracking_threshold;
    configuration.monitors.velocity_error_ms = own.velocity_tracking_time_ms;
  } else {
    configuration.ignored.set(drive::Cause::velocity_error);
  }
  for (std::size_t i = 0; i < own.input_function.size(); ++i) {
    configuration.inputs[i] = {signal_of(own.input_function[i]), false};  // active high (ch. 4.7.6)
  }
  configuration.touch_probe = ismc::touch_probe(own.index_deviation_firmware != 0);
  configuration.remote_outputs = own.output_function;
  configuration.velocity_stop_shape = own.velocity_stop_profile;
  const double rated = static_cast<double>(motor.rated_speed_rpm) / 60.0 * motor.counts_per_revolution;
  configuration.torque_mode_velocity_positive = rated * own.torque_mode_speed_positive / 1000.0;
  configuration.torque_mode_velocity_negative = rated * own.torque_mode_speed_negative / 1000.0;
  configuration.homing_stall_torque = static_cast<float>(own.collision_torque) * 0.001F;
  configuration.homing_stall_ms = own.collision_time_ms;
  configuration.homing_retraction = own.collision_retraction;
  configuration.homing_timeout_ms = own.homing_timeout_ms;
  return configuration;
}

dictionary::AbortCode Ismc::check(const dictionary::Entry& entry, std::span<const std::byte> value) {
  if (entry.index == 0x2004) {
    const std::int64_t rate = dictionary::decode_number(entry.type, value);
    if (std::find(ismc_bit_rates.begin(), ismc_bit_rates.end(), rate) == ismc_bit_rates.end()) {
      return dictionary::AbortCode::value_invalid;
    }
  }
  return dictionary::AbortCode::none;
}

void Ismc::written(const dictionary::Entry& entry) {
  // Bus settings are saved at once, without 1010h, and act after a restart (ch. 2.2).
  if (entry.index == 0x2004 || entry.index == 0x2401) {
    keep(entry);
    return;
  }
  reconfigure();
}

}  // namespace servodrome::products
