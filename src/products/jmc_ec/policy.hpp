#pragma once

#include <array>

#include "drive/policy.hpp"
#include "products/jmc_ec/faults.hpp"
#include "products/jmc_ec/homing_methods.hpp"
#include "products/jmc_ec/units.hpp"

namespace servodrome::products::jmc_ec {

using drive::Mode;
using drive::mode_bit;

// Choices where the manual can also be understood in another way (see README.md of this folder).
inline constexpr bool energised_in_switched_on = true;       // C-30
inline constexpr bool mode_zero_keeps = true;                // 6060h = 0 changes nothing
inline constexpr bool position_change_needs_writing = true;  // D-15: 607Bh limits once it was written
inline constexpr bool end_velocity_is_start = true;          // D-20
inline constexpr bool limit_inputs_follow_polarity = true;   // Table 229
inline constexpr std::uint32_t window_of_zero = 0xFFFFFFFF;  // C-26: 6065h = 0 is off, unless P03-15 is set
inline constexpr std::uint32_t excessive_velocity_faults =   // D-16
    mode_bit(Mode::profile_position) | mode_bit(Mode::cyclic_sync_velocity);

// 60FDh (Table 215).
inline constexpr auto digital_inputs = [] {
  constexpr auto signal = [](std::uint8_t to, drive::Signal from) {
    return drive::DigitalInputBit{to, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(from)};
  };
  return std::array{signal(0, drive::Signal::negative_limit), signal(1, drive::Signal::positive_limit),
                    signal(2, drive::Signal::home), signal(9, drive::Signal::probe_1),
                    signal(10, drive::Signal::probe_2)};
}();

// The upper bits by mode (Table 156 and the tables of the mode chapters).
inline constexpr auto status_bits = [] {
  using drive::StatusBit;
  using drive::StatusSource;
  constexpr std::uint32_t position = mode_bit(Mode::profile_position) | mode_bit(Mode::cyclic_sync_position);
  constexpr std::uint32_t velocity = mode_bit(Mode::profile_velocity) | mode_bit(Mode::cyclic_sync_velocity);
  constexpr std::uint32_t profile_velocity = mode_bit(Mode::profile_velocity);
  constexpr std::uint32_t homing = mode_bit(Mode::homing);
  return std::array{
      StatusBit{8, StatusSource::halt, profile_velocity},  // PV 4, D-09
      StatusBit{9, StatusSource::remote},
      StatusBit{10, StatusSource::target_reached},
      StatusBit{11, StatusSource::software_limit, position},        // Table 156
      StatusBit{12, StatusSource::mode_bit_12, ~profile_velocity},  // D-13
      StatusBit{12, StatusSource::in_motion, profile_velocity},     // Table 264
      StatusBit{13, StatusSource::following_error, position | velocity},
      StatusBit{13, StatusSource::mode_bit_13, homing},
  };
}();

constexpr drive::Policy make_policy() {
  drive::Policy policy;
  policy.modes.supported = mode_bit(Mode::profile_position) | mode_bit(Mode::profile_velocity) |
                           mode_bit(Mode::profile_torque) | mode_bit(Mode::homing) |
                           mode_bit(Mode::cyclic_sync_position) | mode_bit(Mode::cyclic_sync_velocity) |
                           mode_bit(Mode::cyclic_sync_torque);  // Table 219, 6502h
  policy.modes.zero_keeps = mode_zero_keeps;
  policy.power.option_codes = {.quick_stop = 0b110,    // and from 3 on at once (object 605Ah)
                               .quick_stop_stays = 0,  // C-31
                               .quick_stop_continues = 0,
                               .shutdown = 0b11,            // object 605Bh
                               .disable_operation = 0b11,   // object 605Ch
                               .halt = 0b110,               // object 605Dh
                               .fault_reaction = 0b1'1111,  // object 605Eh
                               .at_once_from = 3};
  policy.status.bits = status_bits;
  policy.power.energised_in_switched_on = energised_in_switched_on;
  policy.power.brake_engages_before_off = true;    // ch. 8.2.2, P01-30
  policy.status.cyclic_modes_show_reached = true;  // Tables 222 and 239
  policy.faults.rows = faults;
  policy.faults.first_is_shown = true;
  policy.positioning.queue = 1;                // D-39
  policy.positioning.starts_from_rest = true;  // PP 2
  policy.ramps.zeros_are_greatest = true;      // D-34
  policy.ramps.greatest_limit_homing = false;  // only the profile modes (Tables 211, 212, 258)
  policy.positioning.end_velocity_is_start = end_velocity_is_start;
  policy.limits.excessive_velocity_faults = excessive_velocity_faults;
  policy.limits.target_beyond = drive::OutOfLimits::fault;  // Table 228
  policy.status.slippage = false;
  policy.homing.methods = homing_methods;
  policy.homing.offset_sign = -1;          // with HomingEnd::offset: travelled, and 0 there (D-25)
  policy.homing.errors_are_faults = true;  // the one with a number: AL.551
  policy.terminals.inputs = digital_inputs;
  policy.terminals.brake_output_bit = 0;  // object 60FEh
  policy.terminals.output_count = 0;      // the drive itself controls DO0 and DO1
  policy.terminals.limit_inputs_follow_polarity = limit_inputs_follow_polarity;
  policy.units = units;
  return policy;
}

}  // namespace servodrome::products::jmc_ec
