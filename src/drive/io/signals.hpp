#pragma once

#include <array>
#include <cstdint>

#include "drive/units.hpp"

// What the wires mean. Inputs carry signals by a table that a product fills and may change at run time.
namespace servodrome::drive {

enum class Signal : std::uint8_t {
  none,
  negative_limit,
  positive_limit,
  home,
  index,  // the encoder's Z, always present
  probe_1,
  probe_2,
  external_fault,     // an outside device reports an error
  motor_temperature,  // contact in the motor winding
  quick_stop,
  interlock,
  count_of_signals
};

constexpr std::uint32_t bit(Signal signal) { return 1u << static_cast<unsigned>(signal); }

struct InputFunction {
  Signal signal = Signal::none;
  bool inverted = false;  // the signal is active while the wire is low
};

inline constexpr std::size_t max_inputs = 16;
using InputMap = std::array<InputFunction, max_inputs>;

// A captured transition of a signal, after the input map, at the exact encoder position.
struct SignalEdge {
  Signal signal = Signal::none;
  bool rising = false;
  Counts position = 0;
};

}  // namespace servodrome::drive
