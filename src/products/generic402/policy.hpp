#pragma once

#include "drive/homing/cia402_methods.hpp"
#include "drive/policy.hpp"

namespace servodrome::products::generic402 {

using drive::Cause;
using drive::Reaction;
using drive::ResetRule;

// Error codes of CiA 402-2. Faults without such a code have one in the manufacturer's range FFxxh. Register bits: 0
// generic, 1 current, 2 voltage, 3 temperature, 4 communication, 5 device profile.
inline constexpr auto faults = std::to_array<drive::FaultRow>({
    {Cause::bus_overcurrent, 0x2220, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "DC link overcurrent"},
    {Cause::overcurrent_u, 0x2310, 0x03, Reaction::power_off, ResetRule::when_cause_gone,
     "Continuous overcurrent, phase U"},
    {Cause::overcurrent_v, 0x2311, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Overcurrent, phase V"},
    {Cause::overcurrent_w, 0x2312, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Overcurrent, phase W"},
    {Cause::short_circuit, 0x2320, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Short circuit"},
    {Cause::phase_loss, 0x3321, 0x05, Reaction::power_off, ResetRule::when_cause_gone, "Armature circuit interrupted"},
    {Cause::i2t, 0x2350, 0x03, Reaction::option_code, ResetRule::when_cause_gone, "Load level, I2t"},
    {Cause::over_voltage, 0x3210, 0x05, Reaction::option_code, ResetRule::when_cause_gone, "DC link over-voltage"},
    {Cause::under_voltage, 0x3220, 0x05, Reaction::power_off, ResetRule::when_cause_gone, "DC link under-voltage"},
    {Cause::ambient_hot, 0x4110, 0x09, Reaction::option_code, ResetRule::when_cause_gone, "Excess ambient temperature"},
    {Cause::ambient_cold, 0x4120, 0x09, Reaction::option_code, ResetRule::when_cause_gone,
     "Too low ambient temperature"},
    {Cause::power_stage_hot, 0x4210, 0x09, Reaction::option_code, ResetRule::when_cause_gone,
     "Excess device temperature"},
    {Cause::motor_hot, 0x4310, 0x09, Reaction::option_code, ResetRule::when_cause_gone, "Excess motor temperature"},
    {Cause::motor_contact, 0xFF30, 0x09, Reaction::option_code, ResetRule::when_cause_gone,
     "Motor temperature contact"},
    {Cause::encoder_hot, 0xFF31, 0x09, Reaction::option_code, ResetRule::when_cause_gone, "Excess encoder temperature"},
    {Cause::gate_supply, 0x5111, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Gate driver supply"},
    {Cause::internal_hardware, 0x5200, 0x21, Reaction::power_off, ResetRule::power_cycle, "Control hardware"},
    {Cause::memory, 0x5530, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Non-volatile data memory"},
    {Cause::brake, 0xFF10, 0x21, Reaction::option_code, ResetRule::when_cause_gone, "Brake does not hold"},
    {Cause::encoder_connection, 0x7305, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Encoder connection"},
    {Cause::encoder_crc, 0x7510, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Encoder checksum"},
    {Cause::encoder_delimiter, 0xFF20, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Encoder frame"},
    {Cause::encoder_multi_turn, 0xFF21, 0x21, Reaction::power_off, ResetRule::power_cycle, "Encoder multi-turn"},
    {Cause::encoder_count, 0x7320, 0x21, Reaction::power_off, ResetRule::power_cycle, "Encoder position"},
    {Cause::encoder_count_overflow, 0xFF22, 0x21, Reaction::power_off, ResetRule::clear_multi_turn_and_power_cycle,
     "Encoder turn overflow"},
    {Cause::hall_wiring, 0x7306, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Hall wiring"},
    {Cause::hall_state, 0x7122, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Commutation, Hall state"},
    {Cause::interpolation_overrun, 0x6300, 0x00, Reaction::none, ResetRule::when_cause_gone,
     "Interpolation data record lost"},
    {Cause::communication_lost, 0x8130, 0x11, Reaction::option_code, ResetRule::when_cause_gone, "Master lost"},
    {Cause::over_speed, 0x8400, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Velocity controller, over-speed"},
    {Cause::following_error, 0x8611, 0x21, Reaction::option_code, ResetRule::when_cause_gone, "Following error"},
    {Cause::sync_lost, 0x8700, 0x11, Reaction::option_code, ResetRule::when_cause_gone, "Sync controller"},
    {Cause::external, 0x9000, 0x01, Reaction::option_code, ResetRule::when_cause_gone, "External error"},
});

inline constexpr auto digital_inputs = [] {
  using Source = drive::DigitalInputBit::Source;
  const auto signal = [](std::uint8_t to, drive::Signal from) {
    return drive::DigitalInputBit{to, Source::signal, static_cast<std::uint8_t>(from)};
  };
  // CiA 402-2 60FDh: limits, home and interlock in bits 0 to 3, the terminals in bits 16 and up.
  return std::array{
      signal(0, drive::Signal::negative_limit),
      signal(1, drive::Signal::positive_limit),
      signal(2, drive::Signal::home),
      signal(3, drive::Signal::interlock),
      drive::DigitalInputBit{16, Source::wire, 0},
      drive::DigitalInputBit{17, Source::wire, 1},
      drive::DigitalInputBit{18, Source::wire, 2},
      drive::DigitalInputBit{19, Source::wire, 3},
      drive::DigitalInputBit{20, Source::wire, 4},
      drive::DigitalInputBit{21, Source::wire, 5},
      drive::DigitalInputBit{22, Source::wire, 6},
      drive::DigitalInputBit{23, Source::wire, 7},
      signal(24, drive::Signal::index),
  };
}();

// The factor group of CiA 402-2.
bool units(const drive::Objects& objects, const drive::MotorData& motor, drive::Units& units);

constexpr drive::Policy make_policy() {
  using drive::Mode;
  drive::Policy policy;
  policy.modes.supported = mode_bit(Mode::profile_position) | mode_bit(Mode::velocity) |
                           mode_bit(Mode::profile_velocity) | mode_bit(Mode::profile_torque) | mode_bit(Mode::homing) |
                           mode_bit(Mode::interpolated_position) | mode_bit(Mode::cyclic_sync_position) |
                           mode_bit(Mode::cyclic_sync_velocity) | mode_bit(Mode::cyclic_sync_torque);
  policy.faults.rows = faults;
  policy.homing.methods = drive::cia402_methods;
  policy.terminals.inputs = digital_inputs;
  policy.units = units;
  return policy;
}

}  // namespace servodrome::products::generic402
