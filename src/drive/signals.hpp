#pragma once

#include <array>
#include <cstdint>

#include "drive/units.hpp"

// The meaning of the wires: a table maps inputs to signals. A product fills it and may change it at run time.
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
  enable_refused,    // external equipment is not ready: the motor must not be enabled
  invert_direction,  // reverses the direction in velocity and torque modes
  integral_off,      // switches the integral of the velocity loop off
  count_of_signals
};

constexpr std::uint32_t bit(Signal signal) { return 1u << static_cast<unsigned>(signal); }

// A terminal is on while its wire is high, or while its wire is low if it is `inverted`. A `forced` terminal is always
// on: in this way commissioning tools simulate inputs. The signal is active while the terminal is on, or while it is
// off if it is `normally_closed`.
struct InputFunction {
  Signal signal = Signal::none;
  bool inverted = false;
  bool forced = false;
  bool normally_closed = false;

  constexpr bool active(bool wire_high) const { return (forced || wire_high != inverted) != normally_closed; }
  friend bool operator==(const InputFunction&, const InputFunction&) = default;
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
