#pragma once

#include "drive/policy.hpp"
#include "products/pronet/faults.hpp"
#include "products/pronet/homing_methods.hpp"

namespace servodrome::products::pronet {

// Choices where the manual can also be understood in another way (see README.md of this folder).
inline constexpr std::int8_t home_offset_sign = -1;  // zero = home + 607Ch (ch. 7.2 and 7.2.3)
// "The error cause is found by reading the error code" (ch. 7.2.2). The list in ch. 3.5 has codes for the limit
// switches. It has none for homing that cannot start, so that is "parameter error" of CiA 402.
inline constexpr drive::HomingErrorCodes homing_error_codes{0x8681, 0x8682, 0x6320};
inline constexpr std::int16_t halt_code_of_zero = 1;     // 605Dh reads 0 and acts as 1 (C21)
inline constexpr std::uint32_t resolver_counts = 65536;  // ch. 4; ch. 4.2 has 65535 (C14)

// The encoder's type follows from its counts per turn (ch. 4); a number that is not in the list means incremental.
enum class Encoder : std::uint8_t { incremental, resolver, serial };
constexpr Encoder encoder_of(std::uint32_t counts_per_revolution) {
  if (counts_per_revolution == 131072) return Encoder::serial;
  return counts_per_revolution == resolver_counts ? Encoder::resolver : Encoder::incremental;
}

// 60FDh (ch. 10.1, 60FEh, C38).
inline constexpr auto digital_inputs = std::to_array<drive::DigitalInputBit>({
    {0, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(drive::Signal::negative_limit)},
    {1, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(drive::Signal::positive_limit)},
    {2, drive::DigitalInputBit::Source::signal, static_cast<std::uint8_t>(drive::Signal::home)},
});

// The old factor group: internal = user x numerator / divisor. Internal speeds are 0.1 rpm, accelerations 0.1 rpm/s;
// 6069h is not scaled. The jerk is in pulse / (s x 100 us x 100 us) (ch. 4).
inline bool units(const drive::Objects& objects, const drive::MotorData& motor, drive::Units& units) {
  using drive::Ratio;
  constexpr double jerk_unit = 1e8;  // pulse/s^3
  const auto factor = [](std::uint32_t numerator, std::uint32_t divisor) {
    return static_cast<double>(numerator) / static_cast<double>(divisor);
  };
  if (objects.position_factor_numerator == 0 || objects.position_factor_divisor == 0) return false;
  const Ratio position = Ratio::reduced(objects.position_factor_numerator, objects.position_factor_divisor);
  if (!position.valid()) return false;
  const double tenth_rpm = motor.counts_per_revolution / 600.0;  // counts/s
  units = {};
  units.counts_per_revolution = motor.counts_per_revolution;
  units.position = position;
  units.velocity =
      tenth_rpm * factor(objects.velocity_encoder_factor_numerator, objects.velocity_encoder_factor_divisor);
  units.acceleration = tenth_rpm * factor(objects.acceleration_factor_numerator, objects.acceleration_factor_divisor);
  units.jerk = jerk_unit;
  units.velocity_sensor = tenth_rpm;
  return true;
}

constexpr drive::Policy make_policy() {
  using drive::Mode;
  using drive::RampShape;
  drive::Policy policy;
  // C16
  policy.modes.supported = mode_bit(Mode::profile_position) | mode_bit(Mode::profile_velocity) |
                           mode_bit(Mode::homing) | mode_bit(Mode::interpolated_position);
  policy.power.option_codes = {.quick_stop = 0b110'0111,   // ch. 6.2.5, 605Ah
                               .shutdown = 0b11,           // ch. 6.2.3, 605Bh
                               .disable_operation = 0b11,  // ch. 6.2.4, 605Ch
                               .halt = 0b110,              // ch. 6.2.6, 605Dh
                               .fault_reaction = 0b1};     // ch. 6.2.7 (printed 605Dh)
  policy.power.halt_code_of_zero = halt_code_of_zero;
  policy.status.remote = false;  // ch. 6.2.2: bits 8 and 9 are not used
  policy.faults.rows = faults;
  policy.status.faults_show_as_warning = true;        // ch. 6.2.2
  policy.status.limit_switches_show_as_limit = true;  // ch. 6.2.2
  policy.communication.errors_are_warnings = true;
  policy.communication.loss_is_always_fault = true;
  policy.positioning.queue = 1;                         // ch. 7.4.4
  policy.positioning.acknowledge_blocks_change = true;  // ch. 9.3
  policy.ramps.types = 0b101;                           // ch. 7.4.4: 0 and 2 (C25)
  policy.ramps.shape_of_type[2] = RampShape::jerk_limited;
  policy.ramps.jerk_limited_single_symmetric = true;            // ch. 7.4.4
  policy.status.slippage = false;                               // there is no object for it
  policy.interpolation.source = drive::Interpolation::at_sync;  // ch. 7.5.4
  policy.interpolation.periods = {.least_value = 0, .least_index = -128, .greatest_index = 63};  // ch. 7.5.3, 60C2h
  policy.homing.methods = homing_methods;
  policy.homing.offset_sign = home_offset_sign;
  policy.homing.error_codes = homing_error_codes;
  policy.homing.reached_means_home = true;  // ch. 7.2.2
  policy.terminals.inputs = digital_inputs;
  policy.terminals.output_count = 0;          // no output terminals are described
  policy.terminals.first_bus_input_bit = 24;  // of 60FEh:01: CN1_14 (ch. 10.1)
  policy.units = units;
  return policy;
}

}  // namespace servodrome::products::pronet
