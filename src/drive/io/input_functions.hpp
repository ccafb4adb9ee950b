#pragma once

#include <cstdint>
#include <span>

#include "drive/io/signals.hpp"

// What the terminals of a drive are told to do, for products whose inputs carry a function code each. Functions that
// the drive itself acts on are signals; those that write what a bus master would write are actions
// (input_commands.hpp).
namespace servodrome::drive {

enum class InputAction : std::uint8_t {
  none,
  enable,            // on: a controlword is written; off: shutdown
  reset_errors,      // controlword bit 7
  mode_control,      // chooses between two modes of operation
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
  current_switch,    // the other current limit
  count_of_actions
};

constexpr std::uint32_t bit(InputAction action) { return 1u << static_cast<unsigned>(action); }

// One code of a product's function words. A function may be a signal, an action, or both.
struct InputFunctionRow {
  std::uint16_t code;
  const char* name;
  Signal signal = Signal::none;
  bool normally_closed = false;
  InputAction action = InputAction::none;
};

// The row of `code`, or nullptr: 0 is no function, and no row may have it.
constexpr const InputFunctionRow* find_function(std::span<const InputFunctionRow> rows, std::uint16_t code) {
  for (const InputFunctionRow& row : rows) {
    if (row.code == code) return &row;
  }
  return nullptr;
}

// The terminals and their functions. A terminal is on when its wire is high (low where its polarity bit is 0), or when
// it is simulated.
class InputFunctions {
 public:
  // `codes`: one function word for each terminal from the first on. Polarity and simulation: bit n for terminal n.
  // Terminals beyond `count` do not exist. Codes without a row have no function.
  void assign(std::span<const InputFunctionRow> rows, std::span<const std::uint16_t> codes, std::uint16_t polarity,
              std::uint16_t simulation, std::size_t count);

  // For Configuration::inputs.
  const InputMap& map() const { return map_; }

  // The levels of the wires now. Answers which terminals are on.
  std::uint16_t update(std::uint32_t wires);

  std::uint32_t actions() const { return active_; }     // bit(InputAction) of terminals that are on
  std::uint32_t assigned() const { return assigned_; }  // ... of those that some terminal has
  bool has(InputAction action) const { return (assigned_ & bit(action)) != 0; }
  bool active(InputAction action) const { return (active_ & bit(action)) != 0; }
  // The number that `bits` terminals make, the first of them its bit 0. Bits that no terminal has are 0.
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
