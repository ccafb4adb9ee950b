#pragma once

#include <array>
#include <cstdint>
#include <span>

// The power drive system's finite state automaton (CiA 402-2): states, commands, transitions. Data and functions only;
// the drive implements the effects of a transition on the motor.
namespace servodrome::drive {

enum class PowerState : std::uint8_t {
  not_ready_to_switch_on,
  switch_on_disabled,
  ready_to_switch_on,
  switched_on,
  operation_enabled,
  quick_stop_active,
  fault_reaction_active,
  fault,
};

const char* name(PowerState state);

enum class Command : std::uint8_t {
  none,
  shutdown,
  switch_on,
  enable_operation,

  disable_voltage,
  quick_stop,
};

// Controlword bits (CiA 402-2).
namespace controlword {
inline constexpr std::uint16_t enable_voltage = 1u << 1;
inline constexpr std::uint16_t quick_stop_inactive = 1u << 2;
inline constexpr std::uint16_t enable_operation = 1u << 3;
inline constexpr std::uint16_t mode_bit_4 = 1u << 4;
inline constexpr std::uint16_t mode_bit_5 = 1u << 5;
inline constexpr std::uint16_t mode_bit_6 = 1u << 6;
inline constexpr std::uint16_t fault_reset = 1u << 7;
inline constexpr std::uint16_t halt = 1u << 8;
inline constexpr std::uint16_t mode_bit_9 = 1u << 9;
}  // namespace controlword

// Statusword bits (CiA 402-2).
namespace statusword {
inline constexpr std::uint16_t voltage_enabled = 1u << 4;
inline constexpr std::uint16_t warning = 1u << 7;
inline constexpr std::uint16_t remote = 1u << 9;
inline constexpr std::uint16_t target_reached = 1u << 10;
inline constexpr std::uint16_t internal_limit_active = 1u << 11;
inline constexpr std::uint16_t mode_bit_12 = 1u << 12;
inline constexpr std::uint16_t mode_bit_13 = 1u << 13;
}  // namespace statusword

// Bits 0 to 3, 5 and 6 of the statusword by state.
using StateBits = std::array<std::uint16_t, 8>;
inline constexpr StateBits cia402_state_bits{0x00, 0x40, 0x21, 0x23, 0x27, 0x07, 0x0F, 0x08};
constexpr std::uint16_t state_bits(PowerState state) { return cia402_state_bits[static_cast<std::size_t>(state)]; }

// The command in a controlword's bits 0 to 3 (CiA 402-2). `switch_on` stands for "disable operation" as well.
constexpr Command command_of(std::uint16_t word) {
  if ((word & controlword::enable_voltage) == 0) return Command::disable_voltage;
  if ((word & controlword::quick_stop_inactive) == 0) return Command::quick_stop;
  if ((word & 1u) == 0) return Command::shutdown;
  return (word & controlword::enable_operation) != 0 ? Command::enable_operation : Command::switch_on;
}

struct Transition {
  PowerState from;
  Command command;
  PowerState to;
  std::uint8_t number;  // number in the standard
};
// A transition of some manufacturers: shutdown releases an axis that is held in Quick stop active.
inline constexpr std::uint8_t release_quick_stop = 17;

inline constexpr auto transitions = std::to_array<Transition>({
    {PowerState::switch_on_disabled, Command::shutdown, PowerState::ready_to_switch_on, 2},
    {PowerState::ready_to_switch_on, Command::switch_on, PowerState::switched_on, 3},
    {PowerState::ready_to_switch_on, Command::enable_operation, PowerState::switched_on, 3},
    {PowerState::switched_on, Command::enable_operation, PowerState::operation_enabled, 4},
    {PowerState::operation_enabled, Command::switch_on, PowerState::switched_on, 5},
    {PowerState::switched_on, Command::shutdown, PowerState::ready_to_switch_on, 6},
    {PowerState::ready_to_switch_on, Command::quick_stop, PowerState::switch_on_disabled, 7},
    {PowerState::ready_to_switch_on, Command::disable_voltage, PowerState::switch_on_disabled, 7},
    {PowerState::operation_enabled, Command::shutdown, PowerState::ready_to_switch_on, 8},
    {PowerState::operation_enabled, Command::disable_voltage, PowerState::switch_on_disabled, 9},
    {PowerState::switched_on, Command::disable_voltage, PowerState::switch_on_disabled, 10},
    {PowerState::switched_on, Command::quick_stop, PowerState::switch_on_disabled, 10},
    {PowerState::operation_enabled, Command::quick_stop, PowerState::quick_stop_active, 11},
    {PowerState::quick_stop_active, Command::disable_voltage, PowerState::switch_on_disabled, 12},
    {PowerState::quick_stop_active, Command::enable_operation, PowerState::operation_enabled, 16},
});

// Transitions by state and command; the first row wins. Keeps a reference to the rows; there must be fewer than 256.
class TransitionTable {
 public:
  constexpr explicit TransitionTable(std::span<const Transition> rows) : rows_(rows) {
    for (std::size_t i = rows.size(); i-- > 0;) place(rows[i].from, rows[i].command) = static_cast<std::uint8_t>(i + 1);
  }
  // The transition that `command` triggers in `state`, or nullptr.
  constexpr const Transition* find(PowerState state, Command command) const {
    const std::uint8_t row = row_of_[static_cast<std::size_t>(state)][static_cast<std::size_t>(command)];
    return row == 0 ? nullptr : &rows_[row - 1U];
  }

 private:
  static constexpr std::size_t states = 8;
  static constexpr std::size_t commands = 6;
  constexpr std::uint8_t& place(PowerState state, Command command) {
    return row_of_[static_cast<std::size_t>(state)][static_cast<std::size_t>(command)];
  }

  std::span<const Transition> rows_;
  std::array<std::array<std::uint8_t, commands>, states> row_of_{};  // number of the row, from 1 on; 0: no row
};

}  // namespace servodrome::drive
