#pragma once

#include "drive/policy.hpp"
#include "products/ismc/faults.hpp"
#include "products/ismc/homing_methods.hpp"

namespace servodrome::products::ismc {

// Readings of the manual that could be the other way round (see README.md of this folder).
inline constexpr std::int8_t home_offset_sign = -1;             // G25: zero = home + 607Ch
inline constexpr std::uint32_t counts_per_revolution = 131072;  // G1

inline constexpr auto digital_inputs = std::to_array<drive::DigitalInputBit>({
    {0, drive::DigitalInputBit::Source::wire, 0},  // DI0..DI5 in bits 0..5 (L2673-2680)
    {1, drive::DigitalInputBit::Source::wire, 1},
    {2, drive::DigitalInputBit::Source::wire, 2},
    {3, drive::DigitalInputBit::Source::wire, 3},
    {4, drive::DigitalInputBit::Source::wire, 4},
    {5, drive::DigitalInputBit::Source::wire, 5},
    {6, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(drive::Signal::index)},
});

// No factor group is documented: 1 user unit is 1 count, 1 count/s, 1 count/s^2 (L1096-1099, G31).
inline bool units(const drive::Objects&, const drive::MotorData& motor, drive::Units& units) {
  units = {};
  units.counts_per_revolution = motor.counts_per_revolution;
  return true;
}

// One probe on the rising edge of Z; the DI source and the falling edge are accepted and do nothing (L2592-2667). From
// firmware V1.04 on 60BAh holds the deviation between index pulses (G30).
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
  policy.supported_modes = mode_bit(Mode::profile_position) | mode_bit(Mode::profile_velocity) |
                           mode_bit(Mode::profile_torque) | mode_bit(Mode::homing) |
                           mode_bit(Mode::cyclic_sync_position);  // 000000ADh (L1029-1081, G14)
  policy.option_codes = {.quick_stop = 0b1110'1111,               // 0..3, 5..7 (L1001-1025)
                         .shutdown = 0b11,                        // L917-935
                         .disable_operation = 0b11,               // L937-954
                         .halt = 0b1110,                          // 1..3 (L978-999)
                         .fault_reaction = 0b1111};               // 0..3 (L956-976)
  policy.transition_16 = false;                                   // L809
  policy.dc_link = drive::DcLink::from_switched_on;               // table 3-1 (L777-786)
  policy.faults = faults;
  policy.set_point_queue = 16;                                                                 // L1521
  policy.halt_discards_set_points = true;                                                      // L1523-1530
  policy.jerk_limited_only_from_standstill = true;                                             // L2802
  policy.ramp_shapes = 0b1001;                                                                 // L1314-1331
  policy.zero_values_are_faults = true;                                                        // L2789-2821
  policy.out_of_limits = drive::OutOfLimits::fault;                                            // G20
  policy.limit_switches = drive::LimitSwitches::fault;                                         // G53
  policy.software_limits_switch_range_off = true;                                              // L1159
  policy.slippage_supported = false;                                                           // L1589
  policy.interpolation_periods = {.least_value = 0, .least_index = -3, .greatest_index = -3};  // 0 raises 6553h
  policy.homing_methods = homing_methods;
  policy.home_offset_sign = home_offset_sign;
  policy.homing_errors_are_faults = true;  // G27
  policy.digital_inputs = digital_inputs;
  policy.first_output_bit = 16;  // DO0..DO3 (L2684-2690)
  policy.output_count = 4;
  policy.units = units;
  return policy;
}

}  // namespace servodrome::products::ismc
