#pragma once

#include <array>

#include "drive/faults.hpp"

namespace servodrome::products::ismk {

using drive::Cause;
using drive::Reaction;
using drive::ResetRule;

// The alarms of the manual (chapter 10, L3268-3385; codes L3158-3196) that a plain drive has. The error registers are
// the recommendation of the digest: the manual is silent.
inline constexpr auto faults = std::to_array<drive::FaultRow>({
    {Cause::encoder_connection, 0x7331, 0x41, Reaction::power_off, ResetRule::when_cause_gone,
     "Encoder not connected"},                                                                           // L3348
    {Cause::encoder_crc, 0x7330, 0x41, Reaction::power_off, ResetRule::when_cause_gone, "Encoder CRC"},  // L3351
    {Cause::power_stage_hot, 0x4210, 0x09, Reaction::option_code, ResetRule::when_cause_gone,
     "Driver temperature"},                                                                                   // L3352
    {Cause::over_voltage, 0x3210, 0x05, Reaction::option_code, ResetRule::when_cause_gone, "Overvoltage"},    // L3353
    {Cause::under_voltage, 0x3220, 0x05, Reaction::option_code, ResetRule::when_cause_gone, "Undervoltage"},  // L3354
    {Cause::short_circuit, 0x2320, 0x03, Reaction::power_off, ResetRule::when_cause_gone, "Overcurrent"},     // L3355
    {Cause::following_error, 0x8611, 0x21, Reaction::option_code, ResetRule::when_cause_gone,
     "Following error"},                                                                                       // L3359
    {Cause::i2t, 0x2350, 0x03, Reaction::option_code, ResetRule::when_cause_gone, "Motor or driver IIt"},      // L3363
    {Cause::motor_hot, 0x4310, 0x09, Reaction::option_code, ResetRule::when_cause_gone, "Motor temperature"},  // L3365
    {Cause::communication_lost, 0x8100, 0x11, Reaction::option_code, ResetRule::when_cause_gone,
     "CAN bus fault"},  // L3382
});

}  // namespace servodrome::products::ismk
