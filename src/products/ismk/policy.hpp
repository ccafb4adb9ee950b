#pragma once

#include <array>

#include "drive/homing/cia402_methods.hpp"
#include "drive/policy.hpp"
#include "products/ismk/faults.hpp"
#include "products/ismk/units.hpp"

namespace servodrome::products::ismk {

inline constexpr auto digital_inputs = [] {
  constexpr auto signal = [](std::uint8_t to, drive::Signal from) {
    return drive::DigitalInputBit{to, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(from)};
  };
  // Bit 4, not bit 3, is the interlock (L2005, C25).
  return std::array{signal(0, drive::Signal::negative_limit), signal(1, drive::Signal::positive_limit),
                    signal(2, drive::Signal::home), signal(4, drive::Signal::enable_refused)};
}();

constexpr drive::Policy make_policy() {
  using drive::Mode;
  drive::Policy policy;
  policy.supported_modes = mode_bit(Mode::profile_position) | mode_bit(Mode::profile_velocity) |
                           mode_bit(Mode::profile_torque) | mode_bit(Mode::homing) |
                           mode_bit(Mode::interpolated_position) | mode_bit(Mode::immediate_velocity) |
                           mode_bit(Mode::pulse);  // L1997
  policy.mode_none = false;
  policy.faults = faults;
  policy.software_limits_need_homing = true;  // L1472
  policy.homing_methods = drive::cia402_methods;
  policy.digital_inputs = digital_inputs;
  policy.units = units;
  policy.velocity_loop_ticks = 4;  // 4 kHz and 1 kHz; 60F9h sub 6 bit 7 doubles both (L1605)
  policy.position_loop_ticks = 16;
  return policy;
}

}  // namespace servodrome::products::ismk
