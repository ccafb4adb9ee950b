#pragma once

#include <array>

#include "drive/policy.hpp"
#include "products/ismk/faults.hpp"
#include "products/ismk/homing_methods.hpp"
#include "products/ismk/units.hpp"

namespace servodrome::products::ismk {

using drive::Mode;
using drive::mode_bit;

// Choices where the manual can also be understood in another way (see README.md of this folder).
inline constexpr std::int16_t winding_brake_code =
    18;  // C4: the axis then stays in Quick stop active, as in ch. 5.6.3; in Table 5-2 it does not
inline constexpr bool remote_bit = true;  // C7: set while no input enables the drive

inline constexpr auto digital_inputs = [] {
  constexpr auto signal = [](std::uint8_t to, drive::Signal from) {
    return drive::DigitalInputBit{to, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(from)};
  };
  // The interlock is bit 4 (ch. 7.2), not bit 3 as in CiA 402.
  return std::array{signal(0, drive::Signal::negative_limit), signal(1, drive::Signal::positive_limit),
                    signal(2, drive::Signal::home), signal(4, drive::Signal::enable_refused)};
}();

// Table 5-2: the low bytes of the statusword without bit 4, which is the main circuit.
inline constexpr drive::StateBits state_bits = [] {
  using drive::PowerState;
  drive::StateBits bits = drive::cia402_state_bits;
  const auto set = [&bits](PowerState state, std::uint16_t value) { bits[static_cast<std::size_t>(state)] = value; };
  set(PowerState::switch_on_disabled, 0x60);     // 0070h
  set(PowerState::quick_stop_active, 0x40);      // 0050h
  set(PowerState::fault_reaction_active, 0x28);  // 0038h
  set(PowerState::fault, 0x28);
  return bits;
}();

// Table 5-5.
inline constexpr auto status_bits = [] {
  using drive::StatusBit;
  using drive::StatusSource;
  constexpr std::uint32_t homing = mode_bit(Mode::homing);
  return std::array{
      StatusBit{9, StatusSource::remote},
      StatusBit{10, StatusSource::target_reached, ~homing},  // C037h after homing (ch. 8.3.2)
      StatusBit{11, StatusSource::position_limit},
      StatusBit{12, StatusSource::mode_bit_12, ~homing},
      StatusBit{12, StatusSource::mode_bit_13, homing},  // "origin return to zero error" (Table 5-5, C35)
      StatusBit{13, StatusSource::following_error},
      StatusBit{14, StatusSource::commutation_found},
      StatusBit{15, StatusSource::home_found},
  };
}();

// The transitions of CiA 402, and the exit from a held quick stop: 06h, then 0Fh (ch. 5.6.3).
inline constexpr auto transitions = [] {
  using drive::Command;
  using drive::PowerState;
  std::array<drive::Transition, drive::transitions.size() + 1> table{};
  std::copy(drive::transitions.begin(), drive::transitions.end(), table.begin());
  table.back() = {PowerState::quick_stop_active, Command::shutdown, PowerState::ready_to_switch_on,
                  drive::release_quick_stop};
  return table;
}();

constexpr drive::Policy make_policy() {
  constexpr auto codes = [](std::initializer_list<unsigned> values) {
    std::uint32_t set = 0;
    for (const unsigned value : values) set |= 1u << value;
    return set;
  };
  drive::Policy policy;
  policy.modes.supported = mode_bit(Mode::profile_position) | mode_bit(Mode::profile_velocity) |
                           mode_bit(Mode::profile_torque) | mode_bit(Mode::homing) |
                           mode_bit(Mode::interpolated_position) | mode_bit(Mode::immediate_velocity) |
                           mode_bit(Mode::pulse);  // ch. 7.1, 6060h
  policy.modes.none = false;
  policy.power.option_codes = {.quick_stop = codes({0, 1, 2, 5, 6, winding_brake_code}),  // Table 5-18, 605Ah
                               .quick_stop_stays = codes({5, 6, winding_brake_code}),
                               .quick_stop_continues = codes({5, 6}),                      // Table 5-2
                               .shutdown = codes({0, 1, 2, winding_brake_code}),           // Table 5-18, 605Bh
                               .disable_operation = codes({0, 1, 2, winding_brake_code}),  // Table 5-18, 605Ch
                               .halt = codes({1, 2}),                                      // Table 5-18
                               .fault_reaction = codes({0, 1, 2, winding_brake_code})};    // Table 5-18
  policy.communication.nmt_aborts_connection = false;  // 6007h is about node protection only (Table 9-26)
  policy.power.transitions = transitions;
  policy.power.state_bits = state_bits;
  policy.status.bits = status_bits;
  policy.status.remote = remote_bit;
  policy.modes.without_halt = mode_bit(Mode::profile_torque);  // Table 5-4
  policy.power.brake_engages_before_off = true;                // ch. 5.6.2
  policy.faults.rows = faults;
  policy.single_turn_encoder = true;            // ch. 1.3.1
  policy.power.reset_word_is_a_command = true;  // 86h resets and ends in Ready (Table 5-2, ch. 7.9)
  policy.positioning.queue = 1;
  policy.positioning.target_tracking = 1u << 12;                 // 103Fh (Table 5-4)
  policy.ramps.shaped_modes = mode_bit(Mode::profile_position);  // ch. 6.2.2
  policy.interpolation.source = drive::Interpolation::target;    // ch. 9.5
  policy.limits.software_needs_homing = true;                    // ch. 5.6.1
  policy.homing.methods = homing_methods;
  policy.homing.offset_sign = -1;       // Table 5-14
  policy.homing.counts_at_rest = true;  // bit 15: "not performed or completed" (Table 5-5)
  policy.homing.needs_its_inputs = true;
  policy.terminals.inputs = digital_inputs;
  policy.terminals.output_count = 5;
  policy.loops.velocity_ticks = 4;   // 4 kHz ...
  policy.loops.position_ticks = 16;  // ... and 1 kHz (Table 6-2)
  policy.units = units;
  policy.loops.velocity_ticks = 4;  // 4 kHz and 1 kHz; 60F9h sub 6 bit 7 doubles both (Table 6-2)
  policy.loops.position_ticks = 16;
  return policy;
}

}  // namespace servodrome::products::ismk
