#pragma once

#include <array>
#include <cstdint>

// The interface between a drive and its power stage, motor, encoder and terminals: measured values and outputs of each
// base tick. A simulated plant or the board support of a microcontroller implements it.
namespace servodrome::drive {

inline constexpr double tick_seconds = 62.5e-6;  // the base tick: 16 kHz
inline constexpr std::int64_t ticks_per_second = 16000;

// One transition caught by the capture unit: the exact encoder position at which a wire or the index changed its level.
struct Edge {
  static constexpr std::uint8_t index_source = 32;  // the encoder's index (Z); 0..31 are the input wires
  std::uint8_t source = 0;
  bool rising = false;
  std::int64_t position_counts = 0;
};

// Bits of Feedback::encoder_faults.
enum class EncoderFault : std::uint32_t {
  none = 0,
  connection_lost = 1u << 0,
  crc = 1u << 1,
  delimiter = 1u << 2,
  multi_turn = 1u << 3,
  count = 1u << 4,
  count_overflow = 1u << 5,
  hall_wiring = 1u << 6,  // a Hall wire is open
  hall_state = 1u << 7,   // an impossible Hall combination
};

// Bits of Feedback::hardware_faults: comparators and supervision of the power stage. The power stage latches a bit for
// the tick in which it occurs.
enum class HardwareFault : std::uint32_t {
  none = 0,
  overcurrent_u = 1u << 0,
  overcurrent_v = 1u << 1,
  overcurrent_w = 1u << 2,
  bus_overcurrent = 1u << 3,
  short_circuit = 1u << 4,  // desaturation of a switch
  gate_supply_low = 1u << 5,
  internal = 1u << 6,  // the drive's own electronics (memory, converter)
};

struct Feedback {
  std::int64_t position_counts = 0;        // encoder, multi-turn, quantised
  std::uint32_t single_turn_counts = 0;    // position within the turn, 0 .. counts per revolution - 1
  std::array<float, 3> phase_current_a{};  // U, V, W; of a motor of two windings W is 0
  float dc_link_v = 0.0F;
  std::uint32_t inputs = 0;  // level of wire n in bit n; high = current flows
  bool index_level = false;  // the encoder's index (Z) is high at this position
  std::uint8_t edge_count = 0;
  std::array<Edge, 4> edges{};  // the first `edge_count` are valid, in the order they happened during the tick
  std::uint32_t encoder_faults = 0;
  std::uint32_t hardware_faults = 0;
  bool supply_present = true;  // the mains before the rectifier
  float winding_temperature_c = 25.0F;
  float power_stage_temperature_c = 25.0F;
  float encoder_temperature_c = 25.0F;
  float ambient_temperature_c = 25.0F;
};

struct Actuation {
  bool pwm_enabled = false;    // false: all switches open, the motor coasts
  bool short_circuit = false;  // all low-side switches closed: the windings brake the motor
  bool brake_released = false;
  bool dc_link_connected = false;  // the relay of the drive to the power supply
  bool chopper_on = false;         // brake resistor across the DC link
  std::array<float, 3>
      phase_voltage_v{};      // average over the tick, against the star point; of two windings: across each
  std::uint32_t outputs = 0;  // level of output n in bit n
};

}  // namespace servodrome::drive
