#pragma once

#include <cstdint>
#include <span>

#include "drive/signals.hpp"

// Functions of the input terminals, for products whose inputs have a function code each. A function for the drive
// itself is a signal; a function that writes objects as a bus master would is an action (input_commands.hpp).
namespace servodrome::drive {

enum class InputAction : std::uint8_t {
  none,
  enable,            // on: a controlword is written; off: shutdown
  reset_errors,      // controlword bit 7
  mode_control,      // selects one of two modes of operation
  quick_stop,        // controlword bit 2
  start_homing,      // homing mode until home is found, then the mode before
  activate,          // controlword bit 4
  speed_index_0,     // bits of the index into the table of speeds
  speed_index_1,     //
  speed_index_2,     //
  position_index_0,  // bits of the index into the table of positions
  position_index_1,  //
  position_index_2,  //
  gear_index_0,      // bits of the index into a table of gear ratios
  gear_index_1,      //
  gear_index_2,      //
  gain_index_0,      // bits of the index into the sets of gains
  gain_index_1,      //
  current_switch,    // selects the second current limit
  count_of_actions
};

constexpr std::uint32_t bit(InputAction action) { return 1u << static_cast<unsigned>(action); }

// One code of a product's function words. A function may be a signal, an action, or both.
struct InputFunctionRow {
  std::uint16_t code;
  Signal signal = Signal::none;
  bool normally_closed = false;
  InputAction action = InputAction::none;
};

// Returns the row of `code`, or nullptr. Code 0 means "no function", so no row may have it.
constexpr const InputFunctionRow* find_function(std::span<const InputFunctionRow> rows, std::uint16_t code) {
  for (const InputFunctionRow& row : rows) {
    if (row.code == code) return &row;
  }
  return nullptr;
}

// The terminals and their functions. A terminal is on if its wire is high (low if its polarity bit is 0), or if it is
// simulated.
class InputFunctions {
 public:
  // `codes`: one function word for each terminal from the first on. Polarity and simulation: bit n for terminal n.
  // Terminals beyond `count` do not exist. Codes without a row have no function.
  void assign(std::span<const InputFunctionRow> rows, std::span<const std::uint16_t> codes, std::uint16_t polarity,
              std::uint16_t simulation, std::size_t count);

  // For Configuration::inputs.
  const InputMap& map() const { return map_; }

  // Evaluates the levels of the wires. Returns the terminals that are on.
  std::uint16_t update(std::uint32_t wires);

  std::uint32_t actions() const { return active_; }     // bit(InputAction) of terminals that are on
  std::uint32_t assigned() const { return assigned_; }  // ... of all assigned terminals
  bool has(InputAction action) const { return (assigned_ & bit(action)) != 0; }
  bool active(InputAction action) const { return (active_ & bit(action)) != 0; }
  // The binary number of `bits` terminals; `first` is bit 0. Bits without a terminal are 0.
  std::uint8_t index(InputAction first, unsigned bits) const {
    return static_cast<std::uint8_t>(active_ >> static_cast<unsigned>(first) & ((1u << bits) - 1u));
  }
  bool has_index(InputAction first, unsigned bits) const {
    return (assigned_ >> static_cast<unsigned>(first) & ((1u << bits) - 1u)) != 0;
  }

 private:
  InputMap map_{};
  std::array<InputAction, max_inputs> actions_{};
  std::uint16_t exists_ = 0;
  std::uint16_t polarity_ = 0;
  std::uint16_t simulation_ = 0;
  std::uint32_t assigned_ = 0;
  std::uint32_t active_ = 0;
};

}  // namespace servodrome::drive
