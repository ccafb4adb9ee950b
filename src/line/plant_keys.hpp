#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <variant>

#include "drive/loops/motor_data.hpp"
#include "plant/parameters.hpp"

// The keys of a line file that set members of the plant's parameters. Each key has the name of its member.
// plant::validate checks the ranges; travel.hpp reads the geometry of the travel.
namespace servodrome::line {

template <typename Struct>
struct Key {
  std::string_view name;
  std::variant<double Struct::*, float Struct::*, int Struct::*, std::uint16_t Struct::*, std::uint32_t Struct::*,
               bool Struct::*>
      member;
};

#define SERVODROME_KEY(STRUCT, MEMBER) \
  Key<STRUCT> { #MEMBER, &STRUCT::MEMBER }

inline constexpr std::array motor_keys{
    SERVODROME_KEY(plant::Motor, rated_torque_nm),
    SERVODROME_KEY(plant::Motor, rated_current_a),
    SERVODROME_KEY(plant::Motor, rated_speed_rpm),
    SERVODROME_KEY(plant::Motor, phases),
    SERVODROME_KEY(plant::Motor, pole_pairs),
    SERVODROME_KEY(plant::Motor, resistance_ohm),
    SERVODROME_KEY(plant::Motor, direct_inductance_h),
    SERVODROME_KEY(plant::Motor, quadrature_inductance_h),
    SERVODROME_KEY(plant::Motor, quadrature_saturation_a),
    SERVODROME_KEY(plant::Motor, saturated_inductance_share),
    SERVODROME_KEY(plant::Motor, torque_constant_nm_per_a),
    SERVODROME_KEY(plant::Motor, magnet_temperature_coefficient),
    SERVODROME_KEY(plant::Motor, rotor_inertia_kgm2),
    SERVODROME_KEY(plant::Motor, viscous_friction_nms),
    SERVODROME_KEY(plant::Motor, coulomb_friction_nm),
    SERVODROME_KEY(plant::Motor, iron_hysteresis_nm),
    SERVODROME_KEY(plant::Motor, iron_eddy_nms),
    SERVODROME_KEY(plant::Motor, cogging_torque_nm),
    SERVODROME_KEY(plant::Motor, cogging_periods_per_revolution),
    SERVODROME_KEY(plant::Motor, copper_temperature_coefficient),
    SERVODROME_KEY(plant::Motor, brake_torque_nm),
    SERVODROME_KEY(plant::Motor, brake_release_ms),
    SERVODROME_KEY(plant::Motor, brake_engage_ms),
    SERVODROME_KEY(plant::Motor, brake_rise_ms),
    SERVODROME_KEY(plant::Motor, brake_half_torque_j),
};

// Of each table [[axis.motor.cogging]].
inline constexpr std::array cogging_keys{
    SERVODROME_KEY(plant::CoggingHarmonic, torque_nm),
    SERVODROME_KEY(plant::CoggingHarmonic, periods),
    SERVODROME_KEY(plant::CoggingHarmonic, phase_turns),
};

inline constexpr std::array load_keys{
    SERVODROME_KEY(plant::Load, inertia_kgm2),
    SERVODROME_KEY(plant::Load, viscous_friction_nms),
    SERVODROME_KEY(plant::Load, coulomb_friction_nm),
    SERVODROME_KEY(plant::Load, static_friction_nm),
    SERVODROME_KEY(plant::Load, stribeck_speed_rad_s),
    SERVODROME_KEY(plant::Load, gravity_torque_nm),
    SERVODROME_KEY(plant::Load, external_torque_nm),
    SERVODROME_KEY(plant::Load, cycle_revolutions),
    SERVODROME_KEY(plant::Load, cycle_offset_turns),
    SERVODROME_KEY(plant::Load, arm_torque_nm),
    SERVODROME_KEY(plant::Load, crank_inertia_kgm2),
    SERVODROME_KEY(plant::Load, crank_torque_nm),
    SERVODROME_KEY(plant::Load, crank_ratio),
    SERVODROME_KEY(plant::Load, elastic),
    SERVODROME_KEY(plant::Load, stiffness_nm_per_rad),
    SERVODROME_KEY(plant::Load, damping_nms),
    SERVODROME_KEY(plant::Load, backlash_rad),
    SERVODROME_KEY(plant::Load, belt_length_revolutions),
    SERVODROME_KEY(plant::Load, belt_middle_revolutions),
    SERVODROME_KEY(plant::Load, stop_stiffness_nm_per_rad),
    SERVODROME_KEY(plant::Load, stop_damping_nms),
};

// Of each table [[coupling]].
inline constexpr std::array coupling_keys{
    SERVODROME_KEY(plant::CouplingParameters, ratio),
    SERVODROME_KEY(plant::CouplingParameters, stiffness_nm_per_rad),
    SERVODROME_KEY(plant::CouplingParameters, damping_nms),
    SERVODROME_KEY(plant::CouplingParameters, backlash_rad),
};

inline constexpr std::array supply_keys{
    SERVODROME_KEY(plant::Supply, volts),
    SERVODROME_KEY(plant::Supply, mains_phases),
    SERVODROME_KEY(plant::Supply, mains_hz),
    SERVODROME_KEY(plant::Supply, source_resistance_ohm),
    SERVODROME_KEY(plant::Supply, capacitance_f),
    SERVODROME_KEY(plant::Supply, precharge_time_constant_s),
    SERVODROME_KEY(plant::Supply, bleeder_resistance_ohm),
    SERVODROME_KEY(plant::Supply, standby_w),
    SERVODROME_KEY(plant::Supply, chopper_resistance_ohm),
    SERVODROME_KEY(plant::Supply, charged_at_start),
    SERVODROME_KEY(plant::Supply, overcurrent_a),
    SERVODROME_KEY(plant::Supply, bus_overcurrent_a),
};

inline constexpr std::array encoder_keys{
    SERVODROME_KEY(plant::Encoder, counts_per_revolution),    SERVODROME_KEY(plant::Encoder, direction),
    SERVODROME_KEY(plant::Encoder, commutation_offset_turns), SERVODROME_KEY(plant::Encoder, index_position_counts),
    SERVODROME_KEY(plant::Encoder, index_width_counts),
};

inline constexpr std::array stage_keys{
    SERVODROME_KEY(plant::Stage, ideal),         SERVODROME_KEY(plant::Stage, delay_ticks),
    SERVODROME_KEY(plant::Stage, dead_time_us),  SERVODROME_KEY(plant::Stage, dead_time_compensation),
    SERVODROME_KEY(plant::Stage, switch_drop_v), SERVODROME_KEY(plant::Stage, modulation_limit),
};

inline constexpr std::array sensors_keys{
    SERVODROME_KEY(plant::Sensors, ideal),
    SERVODROME_KEY(plant::Sensors, seed),
    SERVODROME_KEY(plant::Sensors, current_range_a),
    SERVODROME_KEY(plant::Sensors, current_bits),
    SERVODROME_KEY(plant::Sensors, current_noise),
    SERVODROME_KEY(plant::Sensors, current_offset),
    SERVODROME_KEY(plant::Sensors, current_gain_error),
    SERVODROME_KEY(plant::Sensors, encoder_noise_arcsec),
    SERVODROME_KEY(plant::Sensors, encoder_latency_us),
    SERVODROME_KEY(plant::Sensors, eccentricity_arcsec),
    SERVODROME_KEY(plant::Sensors, encoder_lines),
    SERVODROME_KEY(plant::Sensors, interpolation_arcsec),
    SERVODROME_KEY(plant::Sensors, interpolation_second_arcsec),
};

inline constexpr std::array thermal_keys{
    SERVODROME_KEY(plant::Thermal, ambient_c),
    SERVODROME_KEY(plant::Thermal, winding_heat_capacity_j_per_k),
    SERVODROME_KEY(plant::Thermal, winding_to_case_k_per_w),
    SERVODROME_KEY(plant::Thermal, case_heat_capacity_j_per_k),
    SERVODROME_KEY(plant::Thermal, case_to_ambient_k_per_w),
    SERVODROME_KEY(plant::Thermal, stage_heat_capacity_j_per_k),
    SERVODROME_KEY(plant::Thermal, stage_to_ambient_k_per_w),
    SERVODROME_KEY(plant::Thermal, stage_standby_w),
    SERVODROME_KEY(plant::Thermal, stage_resistance_ohm),
};

// Motor parameters of the drive that differ from the true ones (motor_data_of).
inline constexpr std::array nameplate_keys{
    SERVODROME_KEY(drive::MotorData, counts_per_revolution),
    SERVODROME_KEY(drive::MotorData, pole_pairs),
    SERVODROME_KEY(drive::MotorData, rated_current_a),
    SERVODROME_KEY(drive::MotorData, peak_current_a),
    SERVODROME_KEY(drive::MotorData, rated_torque_nm),
    SERVODROME_KEY(drive::MotorData, rated_speed_rpm),
    SERVODROME_KEY(drive::MotorData, max_speed_rpm),
    SERVODROME_KEY(drive::MotorData, torque_constant_nm_per_a),
    SERVODROME_KEY(drive::MotorData, resistance_ohm),
    SERVODROME_KEY(drive::MotorData, inductance_d_h),
    SERVODROME_KEY(drive::MotorData, inductance_q_h),
    SERVODROME_KEY(drive::MotorData, inertia_kgm2),
    SERVODROME_KEY(drive::MotorData, commutation_offset_turns),
};

#undef SERVODROME_KEY

// A drive's motor parameters may be wrong, but its control law must be computable. The ranges are those of the plant,
// widened by a factor of 10.
struct Range {
  std::string_view name;
  double minimum;
  double maximum;
};

inline constexpr std::array nameplate_ranges{
    Range{"counts_per_revolution", 1, 1 << 24}, Range{"pole_pairs", 1, 100},
    Range{"rated_current_a", 1e-6, 1e5},        Range{"peak_current_a", 1e-6, 1e5},
    Range{"rated_torque_nm", 1e-6, 1e5},        Range{"rated_speed_rpm", 1e-3, 1e6},
    Range{"max_speed_rpm", 1e-3, 1e6},          Range{"torque_constant_nm_per_a", 1e-5, 1e4},
    Range{"resistance_ohm", 1e-4, 1e4},         Range{"inductance_d_h", 1e-7, 10},
    Range{"inductance_q_h", 1e-7, 10},          Range{"inertia_kgm2", 1e-9, 1e4},
    Range{"commutation_offset_turns", -1, 1},
};
static_assert(nameplate_ranges.size() == nameplate_keys.size());

}  // namespace servodrome::line
