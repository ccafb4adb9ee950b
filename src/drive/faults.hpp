#pragma once

#include <cstdint>

// Faults as data. A cause is an event in the drive or its surroundings. A product's row for it has the fault's name,
// code, reaction and reset. A cause without a row is not monitored.
namespace servodrome::drive {

enum class Cause : std::uint8_t {
  none,
  // Power stage and supply
  bus_overcurrent,
  overcurrent_u,
  overcurrent_v,
  overcurrent_w,
  short_circuit,
  phase_loss,
  over_voltage,
  under_voltage,
  under_voltage_near,  // a warning before it
  gate_supply,
  internal_hardware,
  power_failure,          // the mains failed
  current_sensor,         // its zero has moved, or its ripple is too great
  current_sensor_origin,  // its zero could not be recorded
  current_saturation,     // the current is beyond what can be measured
  brake_resistor,         // overload
  brake_resistor_hot,     // of the resistor inside of the drive
  brake_resistor_short,
  // Temperature
  ambient_hot,
  ambient_cold,
  power_stage_hot,
  motor_hot,      // measured in the winding
  motor_contact,  // the temperature contact on an input
  encoder_hot,
  // Encoder
  encoder_connection,
  encoder_incremental,  // lost connection, for products with an alarm for each type of encoder
  encoder_resolver,
  encoder_crc,
  encoder_delimiter,
  encoder_multi_turn,
  encoder_count,
  encoder_count_overflow,
  hall_wiring,
  hall_state,
  index_deviation,  // successive index pulses are not one revolution apart
  index_lost,       // no index pulse for some revolutions
  second_encoder_connection,
  second_encoder_count,
  second_encoder_direction,  // counts against the motor's encoder
  // Motion planning
  profile_duration,
  profile_end_velocity_above_start,
  profile_multi_point,
  profile_value_zero,
  end_velocity_above_profile,
  end_velocity_unreachable,
  software_limits_wrong,
  range_limits_wrong,
  velocity_ramp_type,
  motion_profile_type,
  torque_profile_type,
  jerk_limited_while_moving,
  position_deceleration_zero,
  profile_velocity_zero,
  profile_acceleration_zero,
  interpolation_period_zero,
  interpolation_late,  // no set-point with the SYNC for too long
  velocity_deceleration_zero,
  // Homing
  homing_state,
  homing_wrong_limit,
  homing_method,
  homing_timeout,
  // Monitors
  over_speed,
  velocity_excessive,  // a set-point above the greatest speed
  velocity_error,
  following_error,
  following_error_near,  // a warning before it
  position_limit,
  factor_group,  // the factors give no valid ratio
  i2t,
  stage_i2t,  // of the power stage, if separate from the motor's
  i2t_near,   // a warning before it
  stage_i2t_near,
  jammed,    // no motion at the torque limit
  external,  // an outside device, on an input
  enable_refused,
  positive_limit,  // a limit switch, if that is a fault or a warning
  negative_limit,
  velocity_clipped,  // warnings: a set-point that was clipped
  acceleration_clipped,
  position_change_clipped,
  interpolation_overrun,  // a warning: records that the buffer 60C4h could not take
  pulse_frequency,
  brake,
  // The drive's own electronics and memory
  memory,  // stored values are damaged
  watchdog,
  interrupt,
  controller,  // of another type than the firmware is for
  serial_interface,
  // Commissioning
  motor_unknown,   // no data of a motor
  motor_mismatch,  // another motor than the stored one
  calibration,
  not_calibrated,
  angle_jitter,
  angle_no_motion,
  angle_excess,
  angle_timeout,
  phase_sequence,
  // Communication
  communication_lost,
  service_timeout,
  sync_lost,
  bus_off,
  bus_exception,
  bus_overflow,
  bus_passive,
  bus_settings,  // impossible node address or bit rate
  frame_length,
  rpdo_length,
  pdo_mapping,
  unknown_error,
  count_of_causes,
  // Products may define further causes from here.
  first_product_cause = 128
};

// Names of the causes in the bench API: those of the enumerators. An unknown name is Cause::none.
const char* name(Cause cause);
Cause cause_from_name(const char* name);

enum class Reaction : std::uint8_t {
  option_code,  // fault reaction option code 605Eh
  angle_lost,   // the rotor angle is unknown: the option of 605Eh if it needs no angle, else power off
  power_off,    // the motor cannot be controlled: power stage off at once
  none          // a warning: reported, shown in statusword bit 7 while it is there; motion goes on
};

enum class ResetRule : std::uint8_t {
  when_cause_gone,  // controlword bit 7, once the cause has gone
  power_cycle,      // restart of the drive
  // The failed part keeps this fault until it loses its supply; a restart does not clear it.
  power_off,
  clear_multi_turn,                  // controlword bit 7, once the encoder's turns have been cleared
  clear_multi_turn_and_power_cycle,  // the encoder's turns must be cleared before the restart
};

struct FaultRow {
  Cause cause;
  std::uint16_t code;           // 603Fh and EMCY error code
  std::uint8_t error_register;  // bits set in 1001h while the fault is present
  Reaction reaction;
  ResetRule reset;
  const char* name;
  std::uint16_t alarm = 0;  // the product's alarm number, if it has one
};

}  // namespace servodrome::drive
