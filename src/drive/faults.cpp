#include "drive/faults.hpp"

#include <array>

namespace servodrome::drive {

namespace {

struct NamedCause {
  Cause cause;
  const char* name;
};

constexpr auto names = std::to_array<NamedCause>({
    {Cause::bus_overcurrent, "bus_overcurrent"},
    {Cause::overcurrent_u, "overcurrent_u"},
    {Cause::overcurrent_v, "overcurrent_v"},
    {Cause::overcurrent_w, "overcurrent_w"},
    {Cause::short_circuit, "short_circuit"},
    {Cause::phase_loss, "phase_loss"},
    {Cause::over_voltage, "over_voltage"},
    {Cause::under_voltage, "under_voltage"},
    {Cause::under_voltage_near, "under_voltage_near"},
    {Cause::gate_supply, "gate_supply"},
    {Cause::internal_hardware, "internal_hardware"},
    {Cause::current_sensor, "current_sensor"},
    {Cause::current_sensor_origin, "current_sensor_origin"},
    {Cause::current_saturation, "current_saturation"},
    {Cause::brake_resistor, "brake_resistor"},
    {Cause::brake_resistor_hot, "brake_resistor_hot"},
    {Cause::brake_resistor_short, "brake_resistor_short"},
    {Cause::ambient_hot, "ambient_hot"},
    {Cause::ambient_cold, "ambient_cold"},
    {Cause::power_stage_hot, "power_stage_hot"},
    {Cause::motor_hot, "motor_hot"},
    {Cause::motor_contact, "motor_contact"},
    {Cause::encoder_hot, "encoder_hot"},
    {Cause::encoder_connection, "encoder_connection"},
    {Cause::encoder_crc, "encoder_crc"},
    {Cause::encoder_delimiter, "encoder_delimiter"},
    {Cause::encoder_multi_turn, "encoder_multi_turn"},
    {Cause::encoder_count, "encoder_count"},
    {Cause::encoder_count_overflow, "encoder_count_overflow"},
    {Cause::hall_wiring, "hall_wiring"},
    {Cause::hall_state, "hall_state"},
    {Cause::index_deviation, "index_deviation"},
    {Cause::index_lost, "index_lost"},
    {Cause::second_encoder_connection, "second_encoder_connection"},
    {Cause::second_encoder_count, "second_encoder_count"},
    {Cause::second_encoder_direction, "second_encoder_direction"},
    {Cause::profile_duration, "profile_duration"},
    {Cause::profile_end_velocity_above_start, "profile_end_velocity_above_start"},
    {Cause::profile_multi_point, "profile_multi_point"},
    {Cause::profile_value_zero, "profile_value_zero"},
    {Cause::end_velocity_above_profile, "end_velocity_above_profile"},
    {Cause::end_velocity_unreachable, "end_velocity_unreachable"},
    {Cause::software_limits_wrong, "software_limits_wrong"},
    {Cause::range_limits_wrong, "range_limits_wrong"},
    {Cause::velocity_ramp_type, "velocity_ramp_type"},
    {Cause::motion_profile_type, "motion_profile_type"},
    {Cause::torque_profile_type, "torque_profile_type"},
    {Cause::jerk_limited_while_moving, "jerk_limited_while_moving"},
    {Cause::position_deceleration_zero, "position_deceleration_zero"},
    {Cause::profile_velocity_zero, "profile_velocity_zero"},
    {Cause::profile_acceleration_zero, "profile_acceleration_zero"},
    {Cause::interpolation_period_zero, "interpolation_period_zero"},
    {Cause::velocity_deceleration_zero, "velocity_deceleration_zero"},
    {Cause::homing_state, "homing_state"},
    {Cause::homing_wrong_limit, "homing_wrong_limit"},
    {Cause::homing_method, "homing_method"},
    {Cause::homing_timeout, "homing_timeout"},
    {Cause::over_speed, "over_speed"},
    {Cause::velocity_excessive, "velocity_excessive"},
    {Cause::velocity_error, "velocity_error"},
    {Cause::following_error, "following_error"},
    {Cause::following_error_near, "following_error_near"},
    {Cause::position_limit, "position_limit"},
    {Cause::i2t, "i2t"},
    {Cause::stage_i2t, "stage_i2t"},
    {Cause::i2t_near, "i2t_near"},
    {Cause::stage_i2t_near, "stage_i2t_near"},
    {Cause::jammed, "jammed"},
    {Cause::external, "external"},
    {Cause::enable_refused, "enable_refused"},
    {Cause::positive_limit, "positive_limit"},
    {Cause::negative_limit, "negative_limit"},
    {Cause::velocity_clipped, "velocity_clipped"},
    {Cause::acceleration_clipped, "acceleration_clipped"},
    {Cause::position_change_clipped, "position_change_clipped"},
    {Cause::interpolation_overrun, "interpolation_overrun"},
    {Cause::pulse_frequency, "pulse_frequency"},
    {Cause::brake, "brake"},
    {Cause::memory, "memory"},
    {Cause::watchdog, "watchdog"},
    {Cause::interrupt, "interrupt"},
    {Cause::controller, "controller"},
    {Cause::serial_interface, "serial_interface"},
    {Cause::motor_unknown, "motor_unknown"},
    {Cause::motor_mismatch, "motor_mismatch"},
    {Cause::calibration, "calibration"},
    {Cause::not_calibrated, "not_calibrated"},
    {Cause::angle_jitter, "angle_jitter"},
    {Cause::angle_no_motion, "angle_no_motion"},
    {Cause::angle_excess, "angle_excess"},
    {Cause::angle_timeout, "angle_timeout"},
    {Cause::phase_sequence, "phase_sequence"},
    {Cause::communication_lost, "communication_lost"},
    {Cause::service_timeout, "service_timeout"},
    {Cause::sync_lost, "sync_lost"},
    {Cause::power_failure, "power_failure"},
    {Cause::encoder_incremental, "encoder_incremental"},
    {Cause::encoder_resolver, "encoder_resolver"},
    {Cause::interpolation_late, "interpolation_late"},
    {Cause::factor_group, "factor_group"},
    {Cause::bus_off, "bus_off"},
    {Cause::bus_exception, "bus_exception"},
    {Cause::bus_overflow, "bus_overflow"},
    {Cause::bus_passive, "bus_passive"},
    {Cause::bus_settings, "bus_settings"},
    {Cause::frame_length, "frame_length"},
    {Cause::rpdo_length, "rpdo_length"},
    {Cause::pdo_mapping, "pdo_mapping"},
    {Cause::unknown_error, "unknown_error"},
});
static_assert(names.size() + 1 == static_cast<std::size_t>(Cause::count_of_causes));

constexpr bool equal(const char* a, const char* b) {
  while (*a != '\0' && *a == *b) ++a, ++b;
  return *a == *b;
}

}  // namespace

const char* name(Cause cause) {
  for (const NamedCause& row : names) {
    if (row.cause == cause) return row.name;
  }
  return "none";
}

Cause cause_from_name(const char* name) {
  for (const NamedCause& row : names) {
    if (equal(row.name, name)) return row.cause;
  }
  return Cause::none;
}

}  // namespace servodrome::drive
