#pragma once

#include <array>

#include "drive/faults.hpp"

namespace servodrome::products::ismc {

using drive::Cause;
using drive::Reaction;
using drive::ResetRule;

// The fault table of the manual's chapter on troubleshooting (ch. 5). The EMCY code is the fault code. The manual
// prints no error registers: they are this project's choice. The reaction is 605Eh for every fault, except for faults
// after which the current or the rotor angle is unknown: these faults switch the power stage off for any value of
// 605Eh, because the drive could not follow a ramp. Only injection raises faults for which the simulation has no cause
// (calibration, angle identification), faults of an end velocity, which this drive does not have (6181h, 6281h, 6282h,
// G19), and internal errors of path planning (6180h, 6184h).
inline constexpr auto faults = std::to_array<drive::FaultRow>({
    {Cause::bus_overcurrent, 0x2230, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Bus overcurrent"},
    {Cause::overcurrent_u, 0x2310, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "U-phase overcurrent"},
    {Cause::overcurrent_v, 0x2311, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "V-phase overcurrent"},
    // The manual has codes for phases U and V only (ch. 5, 2310h and 2311h). Phase W is reported as a short circuit.
    {Cause::overcurrent_w, 0x2320, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Hardware short circuit"},
    {Cause::short_circuit, 0x2320, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Hardware short circuit"},
    {Cause::phase_loss, 0x3130, 0x05, Reaction::power_off, ResetRule::when_cause_gone, "Lack of phase"},
    {Cause::over_voltage, 0x3210, 0x05, Reaction::option_code, ResetRule::when_cause_gone, "Servo overvoltage"},
    {Cause::under_voltage, 0x3220, 0x05, Reaction::power_off, ResetRule::when_cause_gone, "Servo undervoltage"},
    {Cause::gate_supply, 0x3221, 0x05, Reaction::power_off, ResetRule::when_cause_gone, "PWM drive abnormal"},
    {Cause::ambient_hot, 0x4110, 0x09, Reaction::option_code, ResetRule::when_cause_gone,
     "Ambient temperature overheating"},
    {Cause::ambient_cold, 0x4120, 0x09, Reaction::option_code, ResetRule::when_cause_gone,
     "Ambient temperature underheating"},
    {Cause::power_stage_hot, 0x4310, 0x09, Reaction::option_code, ResetRule::when_cause_gone,
     "Power module overheating"},
    {Cause::profile_duration, 0x6180, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Execution time of planned curve less than 0"},
    {Cause::profile_end_velocity_above_start, 0x6181, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Stop speed greater than initial speed"},
    {Cause::profile_multi_point, 0x6182, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Values not set for continuous multi-point motion"},
    {Cause::homing_state, 0x6184, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Internal state transition error in homing"},
    {Cause::profile_value_zero, 0x6280, 0x21, Reaction::option_code, ResetRule::when_cause_gone, "Wrong profile value"},
    {Cause::end_velocity_above_profile, 0x6281, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Termination speed setting error"},
    {Cause::end_velocity_unreachable, 0x6282, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Termination speed setting error"},
    {Cause::software_limits_wrong, 0x6283, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Software limit setting error"},
    {Cause::range_limits_wrong, 0x6284, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong position limit"},
    {Cause::velocity_ramp_type, 0x6285, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong planned curve type"},
    {Cause::motion_profile_type, 0x6286, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong planned curve type"},
    {Cause::torque_profile_type, 0x6287, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong planned torque curve"},
    {Cause::homing_wrong_limit, 0x6288, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong homing method (limit switch hit)"},
    {Cause::homing_method, 0x6289, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong homing method (not supported)"},
    {Cause::homing_timeout, 0x628B, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Homing process timed out"},
    {Cause::jerk_limited_while_moving, 0x628C, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Initial speed not zero for jerk-limited ramp"},
    {Cause::position_deceleration_zero, 0x6542, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Planned deceleration or quick stop deceleration is 0 (position)"},
    {Cause::profile_velocity_zero, 0x6551, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong target speed"},
    {Cause::profile_acceleration_zero, 0x6552, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong acceleration and deceleration in position and velocity control"},
    {Cause::interpolation_period_zero, 0x6553, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Wrong position track planning period"},
    {Cause::velocity_deceleration_zero, 0x6572, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Planned deceleration or quick stop deceleration is 0"},
    {Cause::motor_contact, 0x7124, 0x09, Reaction::option_code, ResetRule::when_cause_gone, "Motor overheating"},
    {Cause::index_deviation, 0x7320, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Z pulse repetition positioning error"},  // ch. 4.8.1.2, 60BAh; ch. 5, 7320h
    {Cause::encoder_connection, 0x7380, 0x21, Reaction::power_off, ResetRule::when_cause_gone,
     "Encoder connection error"},
    {Cause::encoder_multi_turn, 0x7383, 0x21, Reaction::power_off, ResetRule::power_off,
     "Encoder multi-turn info error"},
    {Cause::encoder_hot, 0x7384, 0x09, Reaction::option_code, ResetRule::when_cause_gone, "Encoder overheating"},
    {Cause::encoder_count, 0x7385, 0x21, Reaction::power_off, ResetRule::power_off, "Encoder count error"},
    {Cause::encoder_count_overflow, 0x7389, 0x21, Reaction::power_off, ResetRule::power_off,
     "Encoder count overflow error"},
    {Cause::encoder_crc, 0x738A, 0x21, Reaction::power_off, ResetRule::when_cause_gone,
     "Encoder communication CRC error"},
    {Cause::encoder_delimiter, 0x738B, 0x21, Reaction::power_off, ResetRule::power_off, "Encoder delimiter error"},
    {Cause::hall_wiring, 0x738C, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Hall error"},
    {Cause::over_speed, 0x8482, 0x21, Reaction::option_code, ResetRule::when_cause_gone, "Exceed maximum speed"},
    {Cause::velocity_error, 0x8483, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Large speed tracking error"},  // ch. 4.4.5, 2200h:01 and 2200h:02
    {Cause::following_error, 0x8611, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Large position deviation"},  // ch. 4.3.5, 6065h and 6066h
    {Cause::position_limit, 0x8612, 0x21, Reaction::option_code, ResetRule::when_cause_gone, "Exceed position limit"},
    {Cause::calibration, 0x8620, 0x21, Reaction::power_off, ResetRule::when_cause_gone,
     "Failed to enable auto calibration"},
    {Cause::sync_lost, 0x8700, 0x11, Reaction::option_code, ResetRule::power_cycle, "Sync error"},
    {Cause::i2t, 0x8900, 0x03, Reaction::option_code, ResetRule::when_cause_gone, "I2T protection alarm"},
    {Cause::not_calibrated, 0x8901, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Alarm of no calibration"},
    {Cause::external, 0x9100, 0x81, Reaction::option_code, ResetRule::when_cause_gone, "DI external input alarm"},
    {Cause::angle_jitter, 0xB010, 0x81, Reaction::power_off, ResetRule::when_cause_gone,
     "Position feedback jitter during angle identification"},
    {Cause::angle_no_motion, 0xB020, 0x81, Reaction::power_off, ResetRule::when_cause_gone,
     "Rotor not moving during angle identification"},
    {Cause::angle_excess, 0xB030, 0x81, Reaction::power_off, ResetRule::when_cause_gone,
     "Large action of angle identification"},
    {Cause::angle_timeout, 0xB040, 0x81, Reaction::power_off, ResetRule::when_cause_gone,
     "Angle identification timed out"},
    {Cause::phase_sequence, 0xB102, 0x81, Reaction::power_off, ResetRule::when_cause_gone,
     "Motor hardly rotates during phase sequence detection"},
    {Cause::hall_state, 0xB104, 0x81, Reaction::power_off, ResetRule::when_cause_gone, "Hall status feedback abnormal"},
    // Not in the manual's table: a master lost by guarding or heartbeat (G4).
    {Cause::communication_lost, 0x8130, 0x11, Reaction::option_code, ResetRule::when_cause_gone, "Master lost"},
    // Not in the manual's table either, because the manual has no 1010h (G32): the memory cannot be used. The code is
    // that of CiA 402-2.
    {Cause::memory, 0x5530, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Non-volatile data memory"},
});

}  // namespace servodrome::products::ismc
