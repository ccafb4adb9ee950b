#pragma once

#include "drive/power/power_state.hpp"
#include "links/time.hpp"

// Controlword and statusword as a master uses them (CiA 402-2 table 24 and the modes' chapters).
namespace servodrome::master {

namespace control_bit = drive::controlword;
namespace status_bit = drive::statusword;

// Controlwords of the commands (CiA 402-2 table 24). A rising edge of fault_reset resets the fault.
namespace command_word {
inline constexpr std::uint16_t disable_voltage = 0x0000;
inline constexpr std::uint16_t quick_stop = 0x0002;
inline constexpr std::uint16_t shutdown = 0x0006;
inline constexpr std::uint16_t switch_on = 0x0007;
inline constexpr std::uint16_t enable_operation = 0x000F;
inline constexpr std::uint16_t fault_reset = control_bit::fault_reset;
}  // namespace command_word

// Returns true if the controlword commands the drive to be, or to become, operation enabled.
constexpr bool commands_operation(std::uint16_t controlword) {
  return (controlword & command_word::enable_operation) == command_word::enable_operation;
}

// Bits 4 to 6 of the controlword in homing and interpolated position mode, and in profile position mode.
inline constexpr std::uint16_t start_homing = control_bit::mode_bit_4;
inline constexpr std::uint16_t enable_interpolation = control_bit::mode_bit_4;
inline constexpr std::uint16_t new_set_point = control_bit::mode_bit_4;
inline constexpr std::uint16_t change_immediately = control_bit::mode_bit_5;
inline constexpr std::uint16_t relative_move = control_bit::mode_bit_6;

// Bit 12 of the statusword in profile position, profile velocity and cyclic synchronous modes.
inline constexpr std::uint16_t set_point_acknowledge = status_bit::mode_bit_12;
inline constexpr std::uint16_t speed_is_zero = status_bit::mode_bit_12;
inline constexpr std::uint16_t follows_target = status_bit::mode_bit_12;

// Returns true in Operation enabled, and while a stop or a fault reaction is under way.
constexpr bool operates(drive::PowerState state) {
  using enum drive::PowerState;
  return state == operation_enabled || state == quick_stop_active || state == fault_reaction_active;
}
// Returns true if the motor may have torque. A JMC drive switches its power stage on in Switched on already.
constexpr bool may_have_torque(drive::PowerState state) {
  return operates(state) || state == drive::PowerState::switched_on;
}

// Abort connection option code: what a drive does when it loses its master (CiA 402-2).
inline constexpr std::uint16_t abort_connection_option = 0x6007;
inline constexpr std::int16_t no_action_at_abort = 0;
inline constexpr std::int16_t malfunction_at_abort = 1;

// A drive clears "target reached" or "homing attained" some cycles after it accepts a set-point or starts homing; until
// then the bit may belong to the previous one. This is the time to wait before the bit counts.
inline constexpr links::Time settling = std::chrono::milliseconds(20);

}  // namespace servodrome::master
