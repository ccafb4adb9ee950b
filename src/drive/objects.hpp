#pragma once

#include <array>
#include <cstdint>

// The values of the CiA 402-2 objects, by the standard's names. Units are the device's user units unless a comment
// says otherwise. The object tables (cia402_section.hpp, products) have index, range and unit.
namespace servodrome::drive {

struct Objects {
  // Device control
  std::uint16_t controlword = 0;
  std::uint16_t statusword = 0;
  std::uint16_t error_code = 0;
  std::int16_t abort_connection_option_code = 1;
  std::int16_t quick_stop_option_code = 2;
  std::int16_t shutdown_option_code = 0;
  std::int16_t disable_operation_option_code = 1;
  std::int16_t halt_option_code = 1;
  std::int16_t fault_reaction_option_code = 2;
  std::int8_t modes_of_operation = 0;
  std::int8_t modes_of_operation_display = 0;
  std::uint32_t supported_drive_modes = 0;

  // Position
  std::int32_t position_demand_value = 0;
  std::int32_t position_actual_internal_value = 0;  // counts
  std::int32_t position_actual_value = 0;
  std::uint32_t following_error_window = 0xFFFFFFFF;
  std::uint16_t following_error_time_out_ms = 0;
  std::uint32_t position_window = 0xFFFFFFFF;
  std::uint16_t position_window_time_ms = 0;
  std::int32_t target_position = 0;
  std::int32_t min_position_range_limit = 0;
  std::int32_t max_position_range_limit = 0;
  std::int32_t home_offset = 0;
  std::int32_t min_position_limit = 0;
  std::int32_t max_position_limit = 0;
  std::uint8_t polarity = 0;
  std::int32_t following_error_actual_value = 0;
  std::int32_t position_demand_internal_value = 0;  // counts
  std::int32_t control_effort = 0;
  std::uint16_t positioning_option_code = 0;

  // Velocity
  std::int32_t velocity_sensor_actual_value = 0;  // counts/s
  std::int16_t sensor_selection_code = 0;
  std::int32_t velocity_demand_value = 0;
  std::int32_t velocity_actual_value = 0;
  std::uint16_t velocity_window = 0;
  std::uint16_t velocity_window_time_ms = 0;
  std::uint16_t velocity_threshold = 0;
  std::uint16_t velocity_threshold_time_ms = 0;
  std::int32_t target_velocity = 0;
  std::int32_t max_slippage = 0;
  std::int16_t vl_target_velocity = 0;  // rpm, scaled by 604Bh and 604Ch
  std::int16_t vl_velocity_demand = 0;
  std::int16_t vl_velocity_actual_value = 0;
  std::uint32_t vl_velocity_min_amount = 0;
  std::uint32_t vl_velocity_max_amount = 0;
  std::uint32_t vl_acceleration_delta_speed = 0;
  std::uint16_t vl_acceleration_delta_time_s = 1;
  std::uint32_t vl_deceleration_delta_speed = 0;
  std::uint16_t vl_deceleration_delta_time_s = 1;
  std::uint32_t vl_quick_stop_delta_speed = 0;
  std::uint16_t vl_quick_stop_delta_time_s = 1;
  std::int16_t vl_set_point_factor_numerator = 1;
  std::int16_t vl_set_point_factor_denominator = 1;
  std::int32_t vl_dimension_factor_numerator = 1;
  std::int32_t vl_dimension_factor_denominator = 1;

  // Torque and current, in thousandths of the rated value
  std::int16_t target_torque = 0;
  std::uint16_t max_torque = 3000;
  std::uint16_t max_current = 3000;
  std::int16_t torque_demand = 0;
  std::uint32_t motor_rated_current_ma = 0;
  std::uint32_t motor_rated_torque_mnm = 0;
  std::int16_t torque_actual_value = 0;
  std::int16_t current_actual_value = 0;
  std::uint32_t dc_link_circuit_voltage_mv = 0;
  std::uint32_t torque_slope = 0;  // thousandths of rated torque per second
  std::int16_t torque_profile_type = 0;
  std::uint16_t positive_torque_limit = 3000;
  std::uint16_t negative_torque_limit = 3000;

  // Profile
  std::uint32_t max_profile_velocity = 0;
  std::uint32_t max_motor_speed_rpm = 0;
  std::uint32_t profile_velocity = 0;
  std::uint32_t end_velocity = 0;
  std::uint32_t profile_acceleration = 0;
  std::uint32_t profile_deceleration = 0;
  std::uint32_t quick_stop_deceleration = 0;
  std::int16_t motion_profile_type = 0;
  std::uint8_t profile_jerk_use = 1;
  std::array<std::uint32_t, 6> profile_jerk{};
  std::uint32_t max_acceleration = 0;
  std::uint32_t max_deceleration = 0;

  // Factor group
  std::uint32_t position_encoder_increments = 0;
  std::uint32_t position_encoder_motor_revolutions = 1;
  std::uint32_t velocity_encoder_increments_per_second = 0;
  std::uint32_t velocity_encoder_revolutions_per_second = 1;
  std::uint32_t gear_motor_revolutions = 1;
  std::uint32_t gear_shaft_revolutions = 1;
  std::uint32_t feed = 0;
  std::uint32_t feed_shaft_revolutions = 1;
  std::uint32_t position_factor_numerator = 1;
  std::uint32_t position_factor_divisor = 1;
  std::uint32_t velocity_encoder_factor_numerator = 1;
  std::uint32_t velocity_encoder_factor_divisor = 1;
  std::uint32_t velocity_factor_numerator = 1;
  std::uint32_t velocity_factor_divisor = 1;
  std::uint32_t acceleration_factor_numerator = 1;
  std::uint32_t acceleration_factor_divisor = 1;
  std::uint32_t si_unit_position = 0;
  std::uint32_t si_unit_velocity = 0;

  // Homing
  std::int8_t homing_method = 0;
  std::uint32_t homing_speed_switch = 0;
  std::uint32_t homing_speed_zero = 0;
  std::uint32_t homing_acceleration = 0;

  // Cyclic and interpolated modes
  std::int32_t position_offset = 0;
  std::int32_t velocity_offset = 0;
  std::int16_t torque_offset = 0;
  std::int16_t interpolation_sub_mode_select = 0;
  std::int32_t interpolation_data_record = 0;
  std::uint8_t interpolation_time_period_value = 1;
  std::int8_t interpolation_time_index = -3;
  std::uint32_t interpolation_maximum_buffer_size = 0;
  std::uint32_t interpolation_actual_buffer_size = 0;
  std::uint8_t interpolation_buffer_organisation = 0;
  std::uint16_t interpolation_buffer_position = 0;
  std::uint8_t interpolation_data_record_size = 4;
  std::uint8_t interpolation_buffer_clear = 0;

  // Touch probe
  std::uint16_t touch_probe_function = 0;
  std::uint16_t touch_probe_status = 0;
  std::array<std::int32_t, 4> touch_probe_position{};  // 60BAh to 60BDh
  std::array<std::int16_t, 2> touch_probe_source{1, 2};
  std::array<std::uint16_t, 4> touch_probe_edge_counter{};

  // Terminals
  std::uint32_t digital_inputs = 0;
  std::uint32_t physical_outputs = 0;
  std::uint32_t output_mask = 0;

  // Motor data
  std::uint16_t motor_type = 10;  // 6402h: 10 = sinusoidal PM brushless
};

}  // namespace servodrome::drive
