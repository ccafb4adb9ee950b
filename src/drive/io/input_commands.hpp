#pragma once

#include <optional>
#include <span>

#include "drive/homing/device_homing.hpp"
#include "drive/io/input_functions.hpp"
#include "drive/objects.hpp"
#include "drive/policy.hpp"

namespace servodrome::drive {

class Drive;

// Commands of inputs: controlwords, modes, targets from tables. They write the same objects as a bus master would, so
// that the bus sees the effect of the inputs, and the last write applies.
class InputCommands {
 public:
  // The product's and the user's values; all of them may change while running.
  struct Settings {
    std::uint16_t enabling_controlword = 0x000F;
    std::uint16_t disabling_controlword = 0x0006;
    std::int8_t mode_off = 0;                  // 6060h while "mode control" is off
    std::int8_t mode_on = 0;                   // ... and on
    std::span<const std::int32_t> positions;   // 607Ah by index
    std::span<const std::int32_t> speeds;      // 60FFh by speed index; 6081h, without sign, by position index
    std::span<const std::int8_t> speed_modes;  // modes in which the speed table replaces 60FFh
    bool speeds_valid = true;                  // further condition for the speed table
  };

  void reset() { *this = {}; }

  // Call this once per position-loop cycle, after the drive's tick().
  void step(const InputFunctions& inputs, const Settings& settings, Drive& drive, Objects& objects);

  // The index of the position that the axis has reached; empty: none.
  std::optional<std::uint8_t> reached() const { return reached_; }

 private:
  void control(const InputFunctions& inputs, const Settings& settings, Drive& drive, Objects& objects);
  void position_table(const InputFunctions& inputs, const Settings& settings, Drive& drive, Objects& objects);
  void homing(Drive& drive, Objects& objects);

  std::uint32_t active_ = 0;    // actions in the last cycle
  std::uint32_t assigned_ = 0;  // assigned actions in the last cycle
  std::uint32_t rising_ = 0;
  std::uint32_t changed_ = 0;       // switched or newly assigned in this cycle
  bool start_bit_is_ours_ = false;  // a change of an index set controlword bit 4
  bool start_bit_was_ = false;
  DeviceHoming homing_{};  // started by an input
  std::optional<std::uint8_t> going_to_;
  std::optional<std::uint8_t> reached_;
};

}  // namespace servodrome::drive
