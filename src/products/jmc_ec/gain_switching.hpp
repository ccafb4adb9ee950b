#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// The choice between the two gain sets of the JMC EC drives, P02-30 to P02-34 (Table 65, ch. 8.2.3).
namespace servodrome::products::jmc_ec {

// P02-30
enum class SwitchingMode : std::uint16_t {
  first,
  second,
  input,  // DI function 9; no parameter can assign it to an input of the EC series (README)
  torque_command,
  speed_command_change,
  speed_command,
  position_deviation,
  position_command,  // non-zero position command
  positioning_incomplete,
  actual_speed,
  command_and_speed,  // second set while there is a position command, and then until the axis is slow
};

class GainSwitching {
 public:
  struct Settings {
    SwitchingMode mode = SwitchingMode::first;
    double level = 0.0;
    double hysteresis = 0.0;         // on both sides of the level, at most as large as the level
    std::uint32_t delay_cycles = 0;  // from second to first
    std::uint32_t blend_cycles = 0;  // for the position gain to change from one set to the other
  };
  // Values in the units of P02-31, without sign; the flags have no unit.
  struct Inputs {
    bool input = false;
    double torque_command = 0.0;
    double speed_command = 0.0;  // signed
    double position_deviation = 0.0;
    double actual_speed = 0.0;
    bool position_command = false;
    bool positioned = false;
  };

  // Once per position-loop cycle. True when the gains to be used have changed.
  bool update(const Settings& settings, const Inputs& inputs);

  // The set in use, and the blend of the position gain between the first set (0) and the second (1).
  std::size_t set() const { return set_; }
  double blend() const { return blend_; }

  // Cycles over which a change of the speed command is measured: 10 ms.
  static constexpr std::size_t change_cycles = 20;

 private:
  bool wants_second(const Settings& settings, const Inputs& inputs) const;
  double change_of(double speed_command);

  std::size_t set_ = 0;
  double blend_ = 0.0;
  std::uint32_t waited_ = 0;  // cycles for which the first set has been due
  std::array<double, change_cycles> speed_commands_{};
  std::size_t next_ = 0;
  double change_ = 0.0;
};

}  // namespace servodrome::products::jmc_ec
