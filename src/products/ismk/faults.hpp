#pragma once

#include <array>

#include "drive/faults.hpp"

namespace servodrome::products::ismk {

using drive::Cause;
using drive::Reaction;
using drive::ResetRule;

// The bit of an alarm: 0..15 are in 2601h, 16..31 in 2602h, 32..47 in 2605h sub 7. A bit of 2605h sub 7 gives the
// detail of a bit of the other two words, and both are set together. The number of the other bit is in the high byte.
// No detail has bit 0 of 2601h, because that bit only says that 2602h is not 0 (Table 10-1).
constexpr std::uint16_t state_bit(unsigned bit) { return static_cast<std::uint16_t>(bit); }
constexpr std::uint16_t state_2_bit(unsigned bit) { return static_cast<std::uint16_t>(16 + bit); }
constexpr std::uint16_t extension_bit(unsigned bit, std::uint16_t detailed) {
  return static_cast<std::uint16_t>(unsigned{detailed} << 8U | (32U + bit));
}

// The alarms of the manual's chapter 10 with their emergency codes (ch. 9.3.3.6). The manual prints no error registers:
// they are this project's choice. The reaction is 605Eh for every alarm, with two exceptions. An alarm after which the
// current is unknown switches the power stage off for any value of 605Eh. After an alarm that leaves the rotor angle
// unknown, the only option of 605Eh that still works is braking by short circuit, "even if the encoder is wrong" (ch.
// 5.6.3). Alarms whose remedy in the manual is "restart" or "service" are reset by a restart only.
//
// Where the manual names no cause, the assignment of causes to rows is this project's choice: all over-current
// comparators of the plant are one alarm; encoder telegrams that stop are 400.0 (time-out), telegrams that are missing
// from the start are 000.2; the gate supply depends on the logic supply; a fault of the drive's electronics is "MCU".
// Only injection raises alarms that have no cause in this drive: the chopper (the iSMK has none, ch. 1.3.1), pulses and
// the second encoder (no terminals), the current sensor, watchdog, interrupt, SPI, the motor's identification, and
// 81FFh, because the manual does not say which bus it means.
inline constexpr auto faults = [] {
  constexpr auto option_code = Reaction::option_code;
  constexpr auto angle_lost = Reaction::angle_lost;
  constexpr auto power_off = Reaction::power_off;
  constexpr auto reset = ResetRule::when_cause_gone;
  constexpr auto restart = ResetRule::power_cycle;
  const auto overcurrent = [](Cause cause) {  // Table 10-5, 008.0
    return drive::FaultRow{cause,         0x2320,      0x03, Reaction::power_off, ResetRule::when_cause_gone,
                           "Overcurrent", state_bit(7)};
  };
  const auto motor_temperature = [](Cause cause) {  // Table 10-5, 200.0
    return drive::FaultRow{
        cause, 0x4310, 0x09, Reaction::option_code, ResetRule::when_cause_gone, "Motor temperature", state_bit(13)};
  };
  return std::to_array<drive::FaultRow>({
      {Cause::motor_mismatch, 0x6320, 0x01, power_off, restart, "Motor wrongly configured", state_2_bit(4)},  // FFF.F
      // 2601h (Table 10-1)
      {Cause::encoder_connection, 0x7331, 0x41, angle_lost, reset, "Encoder not connected", state_bit(1)},
      {Cause::encoder_multi_turn, 0x7320, 0x41, option_code, ResetRule::clear_multi_turn, "Encoder internal fault",
       state_bit(2)},  // Table 10-5, 000.4
      {Cause::encoder_crc, 0x7330, 0x41, angle_lost, reset, "Encoder CRC", state_bit(3)},
      {Cause::power_stage_hot, 0x4210, 0x09, option_code, reset, "Driver temperature", state_bit(4)},
      {Cause::over_voltage, 0x3210, 0x05, option_code, reset, "Overvoltage", state_bit(5)},
      {Cause::under_voltage, 0x3220, 0x05, power_off, reset, "Undervoltage", state_bit(6)},
      overcurrent(Cause::overcurrent_u),
      overcurrent(Cause::overcurrent_v),
      overcurrent(Cause::overcurrent_w),
      overcurrent(Cause::bus_overcurrent),
      overcurrent(Cause::short_circuit),
      {Cause::brake_resistor, 0x7110, 0x01, option_code, reset, "Chop resistor", state_bit(8)},
      {Cause::following_error, 0x8611, 0x21, option_code, reset, "Following error", state_bit(9)},
      {Cause::gate_supply, 0x5112, 0x05, power_off, reset, "Low logic voltage", state_bit(10)},
      {Cause::i2t, 0x2350, 0x03, option_code, reset, "Motor or driver IIt", state_bit(11)},
      {Cause::pulse_frequency, 0x8A80, 0x21, option_code, reset, "Over frequency", state_bit(12)},
      motor_temperature(Cause::motor_hot),
      motor_temperature(Cause::motor_contact),  // the input "motor error" (ch. 7.9)
      {Cause::encoder_delimiter, 0x7331, 0x41, angle_lost, reset, "Encoder information", state_bit(14)},
      {Cause::memory, 0x6310, 0x01, option_code, restart, "EEPROM data", state_bit(15)},
      // 2602h (Table 10-2)
      {Cause::current_sensor, 0x5210, 0x03, power_off, reset, "Current sensor", state_2_bit(0)},
      {Cause::watchdog, 0x6010, 0x01, power_off, restart, "Watchdog", state_2_bit(1)},
      {Cause::interrupt, 0x6011, 0x01, power_off, restart, "Wrong interrupt", state_2_bit(2)},
      {Cause::internal_hardware, 0x7400, 0x01, power_off, restart, "MCU fault", state_2_bit(3)},
      {Cause::motor_unknown, 0x6320, 0x01, power_off, restart, "Motor configuration", state_2_bit(4)},
      {Cause::enable_refused, 0x5443, 0x21, option_code, reset, "External enable", state_2_bit(8)},
      {Cause::positive_limit, 0x5442, 0x21, option_code, reset, "Positive limit", state_2_bit(9)},
      {Cause::negative_limit, 0x5441, 0x21, option_code, reset, "Negative limit", state_2_bit(10)},
      {Cause::serial_interface, 0x6012, 0x01, power_off, restart, "SPI internal", state_2_bit(11)},
      {Cause::communication_lost, 0x8100, 0x11, option_code, reset, "CAN bus fault", state_2_bit(12)},
      {Cause::second_encoder_direction, 0x8A81, 0x41, option_code, reset, "Closed loop direction", state_2_bit(13)},
      {Cause::second_encoder_connection, 0x7382, 0x41, option_code, reset, "Master ABZ", state_2_bit(14)},
      {Cause::second_encoder_count, 0x7306, 0x41, option_code, reset, "Master counting", state_2_bit(15)},
      // 2605h sub 7 (Table 10-3)
      {Cause::current_sensor_origin, 0x5210, 0x03, power_off, reset, "Origin record", extension_bit(0, state_2_bit(0))},
      {Cause::brake_resistor_hot, 0x7111, 0x01, option_code, reset, "Internal braking resistor over-temperature",
       extension_bit(1, state_bit(8))},
      {Cause::brake_resistor_short, 0x7112, 0x01, option_code, restart, "Internal braking resistor short circuit",
       extension_bit(2, state_bit(8))},
      {Cause::phase_loss, 0x6321, 0x01, power_off, reset, "Motor phase loss", extension_bit(3, state_2_bit(4))},
      {Cause::current_saturation, 0x2321, 0x03, power_off, reset, "ADC sampling saturation",
       extension_bit(4, state_bit(7))},
      {Cause::service_timeout, 0x81FF, 0x11, option_code, reset, "Service timeout", extension_bit(12, state_2_bit(12))},
  });
}();

}  // namespace servodrome::products::ismk
