#pragma once

#include "drive/policy.hpp"
#include "products/ismc/faults.hpp"
#include "products/ismc/homing_methods.hpp"

namespace servodrome::products::ismc {

// Choices where the manual can also be understood in another way (see README.md of this folder).
inline constexpr std::int8_t home_offset_sign = -1;             // G25: zero = home + 607Ch
inline constexpr std::uint32_t counts_per_revolution = 131072;  // G1

inline constexpr auto digital_inputs = std::to_array<drive::DigitalInputBit>({
    {0, drive::DigitalInputBit::Source::wire, 0},  // DI0..DI5 in bits 0..5 (Table 4-91)
    {1, drive::DigitalInputBit::Source::wire, 1},
    {2, drive::DigitalInputBit::Source::wire, 2},
    {3, drive::DigitalInputBit::Source::wire, 3},
    {4, drive::DigitalInputBit::Source::wire, 4},
    {5, drive::DigitalInputBit::Source::wire, 5},
    {6, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(drive::Signal::index)},
});

// No factor group is documented: 1 user unit is 1 count, 1 count/s, 1 count/s^2 (ch. 4.3.2, G31).
inline bool units(const drive::Objects&, const drive::MotorData& motor, drive::Units& units) {
  units = {};
  units.counts_per_revolution = motor.counts_per_revolution;
  return true;
}

// One probe on the rising edge of Z. The DI source and the falling edge are accepted and have no effect (ch. 4.8.1,
// G29). From firmware V1.04 on 60BAh holds the deviation between index pulses (G30).
constexpr drive::TouchProbeCapability touch_probe(bool latches_index_deviation) {
  using IndexValue = drive::TouchProbeCapability::IndexValue;
  return {.probes = 1,
          .index_rising = true,
          .source_status = true,
          .index_value = latches_index_deviation ? IndexValue::deviation : IndexValue::position};
}

constexpr drive::Policy make_policy() {
  using drive::Mode;
  drive::Policy policy;
  policy.modes.supported = mode_bit(Mode::profile_position) | mode_bit(Mode::profile_velocity) |
                           mode_bit(Mode::profile_torque) | mode_bit(Mode::homing) |
                           mode_bit(Mode::cyclic_sync_position);  // 000000ADh (ch. 4.1 and 4.2, G14)
  policy.power.option_codes = {.quick_stop = 0b1110'1111,         // ch. 3.4: 0..3, 5..7
                               .shutdown = 0b11,                  // ch. 3.4
                               .disable_operation = 0b11,         // ch. 3.4
                               .halt = 0b1110,                    // 1..3
                               .fault_reaction = 0b1111};         // 0..3
  policy.power.transition_16 = false;                             // Table 3-2
  policy.power.dc_link = drive::DcLink::from_switched_on;         // Table 3-1
  policy.faults.rows = faults;
  policy.positioning.queue = 16;                            // ch. 4.3.6, 'Multi point immediate effect mode'
  policy.positioning.halt_discards = true;                  // ch. 4.3.6, 'Point to point stop'
  policy.ramps.jerk_limited_only_from_standstill = true;    // ch. 5, 628Ch
  policy.ramps.types = 0b1001;                              // ch. 4.3.5
  policy.ramps.zeros_are_faults = true;                     // ch. 5
  policy.limits.target_beyond = drive::OutOfLimits::fault;  // G20
  policy.limits.switches = drive::LimitSwitches::fault;     // G53
  policy.limits.software_switches_range_off = true;         // ch. 4.3.5, 607Bh
  policy.status.slippage = false;                           // Table 4-43
  policy.interpolation.periods = {.least_value = 0, .least_index = -3, .greatest_index = -3};  // 0 raises 6553h
  policy.homing.methods = homing_methods;
  policy.homing.offset_sign = home_offset_sign;
  policy.homing.errors_are_faults = true;  // G27
  policy.terminals.inputs = digital_inputs;
  policy.terminals.first_output_bit = 16;  // DO0..DO3 (Table 4-92)
  policy.terminals.output_count = 4;
  policy.units = units;
  return policy;
}

}  // namespace servodrome::products::ismc
