#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "drive/modes/windows.hpp"
#include "drive/units.hpp"

// Conditions that outputs can show, for products whose outputs have a function code each.
namespace servodrome::drive {

class Drive;

enum class OutputCondition : std::uint8_t {
  none,
  ready,             // no fault: the drive is enabled or can be
  error,             // fault, or the reaction to it
  position_reached,  // in the modes with a target position
  zero_speed,
  brake_released,
  speed_reached,  // in the modes with a target velocity
  index,          // the encoder's index is passed
  speed_limit,    // torque mode runs at its greatest speed
  enabled,
  position_limit,  // at a limit switch or software limit
  home_found,
  torque_reached,
  reached_index_0,  // bits of the index of the reached position
  reached_index_1,  //
  reached_index_2,  //
  safe_torque_off,
  count_of_conditions
};

constexpr std::uint32_t bit(OutputCondition condition) { return 1u << static_cast<unsigned>(condition); }

// One code of a product's function words.
struct OutputFunctionRow {
  std::uint16_t code;
  OutputCondition condition;
};

constexpr const OutputFunctionRow* find_function(std::span<const OutputFunctionRow> rows, std::uint16_t code) {
  for (const OutputFunctionRow& row : rows) {
    if (row.code == code) return &row;
  }
  return nullptr;
}

// Evaluates the conditions, including those that need time.
class OutputConditions {
 public:
  struct Settings {
    Counts zero_speed_counts_per_ms = 0;  // greatest speed
    std::uint32_t zero_speed_ms = 0;      // least time
    float torque_current_a = 0.0F;        // least torque-producing current, amplitude; 0: not evaluated
    std::uint32_t torque_ms = 0;          // least time
    std::optional<std::uint8_t> reached_index{};
  };

  void reset() { *this = {}; }

  // Call this once per position-loop cycle, after the drive's tick(). Returns the true conditions, as
  // bit(OutputCondition).
  std::uint32_t update(const Drive& drive, const Settings& settings);

 private:
  Dwell zero_speed_{};
  Dwell torque_{};
};

}  // namespace servodrome::drive
