#pragma once

#include <array>

#include "drive/faults.hpp"

namespace servodrome::products::pronet {

using drive::Cause;
using drive::Reaction;
using drive::ResetRule;

// A 69 has no EMCY code of its own (C12, C13); its low byte is the panel's number (ch. 3.5).
inline constexpr std::uint16_t interpolation_overtime_code = 0x8169;

// The alarms (ch. 3.5, and A 69 in ch. 7.5.4). The manual prints neither error registers nor which alarms are warnings:
// both are this project's choice. The reaction to an alarm is 605Eh, whose only value is power off: the motor coasts.
// Bit 7 of the controlword resets every alarm. Only injection raises 5210h, 5421h, 5583h, 6100h, 6120h and 8100h,
// because the simulated drive has no part that could fail in this way.
inline constexpr auto faults = std::to_array<drive::FaultRow>({
    {Cause::overcurrent_u, 0x2310, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Over current"},
    {Cause::overcurrent_v, 0x2310, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Over current"},
    {Cause::overcurrent_w, 0x2310, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Over current"},
    {Cause::bus_overcurrent, 0x2310, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Over current"},
    {Cause::short_circuit, 0x2310, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Over current"},
    {Cause::power_failure, 0x3100, 0x05, Reaction::power_off, ResetRule::when_cause_gone,
     "Instantaneous power failure"},
    {Cause::over_voltage, 0x3110, 0x05, Reaction::power_off, ResetRule::when_cause_gone, "Over voltage"},
    {Cause::under_voltage, 0x3120, 0x05, Reaction::power_off, ResetRule::when_cause_gone, "Under voltage"},
    {Cause::internal_hardware, 0x5080, 0x01, Reaction::power_off, ResetRule::when_cause_gone, "RAM exception"},
    {Cause::current_sensor, 0x5210, 0x01, Reaction::power_off, ResetRule::when_cause_gone, "AD sampling error"},
    {Cause::brake_resistor, 0x5420, 0x01, Reaction::power_off, ResetRule::when_cause_gone,
     "Regenerative resistor error"},
    {Cause::brake_resistor_short, 0x5421, 0x01, Reaction::power_off, ResetRule::when_cause_gone,
     "Regenerative resistor exception"},
    {Cause::memory, 0x5581, 0x81, Reaction::power_off, ResetRule::when_cause_gone, "Parameter checksum exception"},
    {Cause::factor_group, 0x5582, 0x81, Reaction::power_off, ResetRule::when_cause_gone, "Electronic gear error"},
    {Cause::motor_mismatch, 0x5583, 0x81, Reaction::power_off, ResetRule::when_cause_gone,
     "Motor type or drive type error"},
    {Cause::unknown_error, 0x6100, 0x81, Reaction::power_off, ResetRule::when_cause_gone, "Illegal error code"},
    {Cause::pdo_mapping, 0x6120, 0x11, Reaction::none, ResetRule::when_cause_gone, "PDO mapping error"},
    {Cause::bus_settings, 0x6300, 0x11, Reaction::power_off, ResetRule::when_cause_gone, "CAN communication error"},
    // The three encoder alarms. 7303h: errors in the telegrams of a serial encoder; the others follow from the
    // encoder's type.
    {Cause::encoder_connection, 0x7303, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Serial encoder error"},
    {Cause::encoder_crc, 0x7303, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Serial encoder error"},
    {Cause::encoder_delimiter, 0x7303, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Serial encoder error"},
    {Cause::encoder_multi_turn, 0x7303, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Serial encoder error"},
    {Cause::encoder_count, 0x7303, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Serial encoder error"},
    {Cause::encoder_count_overflow, 0x7303, 0x21, Reaction::power_off, ResetRule::when_cause_gone,
     "Serial encoder error"},
    {Cause::encoder_incremental, 0x7305, 0x21, Reaction::power_off, ResetRule::when_cause_gone,
     "Incremental encoder error"},
    {Cause::hall_wiring, 0x7305, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Incremental encoder error"},
    {Cause::hall_state, 0x7305, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Incremental encoder error"},
    {Cause::encoder_resolver, 0x7380, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Resolver error"},
    {Cause::bus_exception, 0x8100, 0x11, Reaction::power_off, ResetRule::when_cause_gone,
     "CAN communication exception"},
    {Cause::bus_overflow, 0x8110, 0x11, Reaction::none, ResetRule::when_cause_gone, "CAN bus overflow"},
    {Cause::bus_passive, 0x8120, 0x11, Reaction::none, ResetRule::when_cause_gone, "CAN controller error passive"},
    {Cause::communication_lost, 0x8130, 0x11, Reaction::power_off, ResetRule::when_cause_gone, "Heartbeat error"},
    {Cause::bus_off, 0x8140, 0x11, Reaction::power_off, ResetRule::when_cause_gone, "CAN bus off"},
    {Cause::frame_length, 0x8200, 0x11, Reaction::none, ResetRule::when_cause_gone, "CAN message length error"},
    {Cause::rpdo_length, 0x8210, 0x11, Reaction::none, ResetRule::when_cause_gone, "Received PDO length error"},
    {Cause::i2t, 0x8311, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Overload"},
    {Cause::over_speed, 0x8480, 0x21, Reaction::power_off, ResetRule::when_cause_gone, "Over speed"},
    {Cause::positive_limit, 0x8681, 0x21, Reaction::none, ResetRule::when_cause_gone, "Forward run prohibited (POT)"},
    {Cause::negative_limit, 0x8682, 0x21, Reaction::none, ResetRule::when_cause_gone, "Reverse run prohibited (NOT)"},
    {Cause::interpolation_late, interpolation_overtime_code, 0x11, Reaction::power_off, ResetRule::when_cause_gone,
     "Interpolation cycle overtime", 0x69},  // ch. 7.5.4
});

}  // namespace servodrome::products::pronet
