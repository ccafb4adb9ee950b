#pragma once

// The reference drive: explanations of its codes, more detailed than those of the standard.
#include <array>

#include "catalogue/fault_texts.hpp"

namespace servodrome::catalogue::generic402 {

inline constexpr std::string_view motor_cable = "Check the motor cable and the motor's insulation.";
inline constexpr std::string_view cool = "Improve cooling or lower the load; let it cool down before the reset.";
inline constexpr std::string_view encoder_cable = "Check encoder cable, shield and plug.";
inline constexpr std::string_view restart = "Switch the supply off and on; if it comes back, replace the encoder.";

inline constexpr auto fault_texts = std::to_array<FaultText>({
    {0x2220, "DC link overcurrent", "The current of the DC link is above its limit, in either direction.",
     "Lower accelerations and decelerations; check the supply."},
    {0x2310, "over-current, phase U",
     "The current of phase U passed its limit: short circuit, earth fault or gains too high.", motor_cable},
    {0x2311, "over-current, phase V",
     "The current of phase V passed its limit: short circuit, earth fault or gains too high.", motor_cable},
    {0x2312, "over-current, phase W",
     "The current of phase W passed its limit: short circuit, earth fault or gains too high.", motor_cable},
    {0x2320, "short circuit", "Two motor phases touch, or one touches earth.", motor_cable},
    {0x2350, "load level (I2t)", "The motor carried more than its rated current for too long.",
     "Lower load, accelerations or duty cycle; look for what jams or a brake that drags."},
    {0x3210, "DC link over-voltage",
     "The supply is too high, or braking feeds back more energy than the DC link absorbs.",
     "Check the supply; lower decelerations."},
    {0x3220, "DC link under-voltage", "The supply is off, too low, or drops under load.",
     "Switch the supply on; check its current limit and the cable."},
    {0x3321, "motor phase open", "A motor phase carries no current.", "Check the motor's plug and cable."},
    {0x4110, "ambient too hot", "The ambient temperature is above the limit of the drive.", cool},
    {0x4120, "ambient too cold", "The ambient temperature is below the limit of the drive.",
     "Warm the cabinet before work."},
    {0x4210, "power stage too hot", "The power stage is hotter than its limit.", cool},
    {0x4310, "motor too hot", "The winding is hotter than its limit.", cool},
    {0x5111, "gate driver supply", "The supply of the power stage's drivers is missing.",
     "Check the control supply; if it is right, replace the drive."},
    {0x5200, "control hardware", "The drive's own electronics failed.",
     "Switch the supply off and on; if it comes back, replace the drive."},
    {0x5530, "stored parameters lost",
     "The stored values are damaged, of another product, or unreadable: the drive uses factory values.",
     "Set and store the parameters, or restore the defaults (1011h); check the file of the memory."},
    {0x6300, "interpolation record lost", "A record (60C1h) came while the buffer was full. A warning.",
     "Write one record per 60C2h, or make the buffer larger (60C4h:02); clearing it (60C4h:06) ends the warning."},
    {0x7122, "commutation", "The Hall signals show an impossible state.", "Check the Hall signals' wiring."},
    {0x7305, "encoder connection", "The encoder does not answer.", encoder_cable},
    {0x7306, "Hall wiring", "Hall signals are missing.", "Check the Hall signals' wiring."},
    {0x7320, "encoder position", "The encoder has detected an error of its counter.", restart},
    {0x7510, "encoder checksum", "Telegrams of the encoder arrive damaged.", encoder_cable},
    {0x8130, "master lost", "The master's heartbeat, guarding or process data are missing.",
     "Check that the master runs and its cycle; reset and enable again."},
    {0x8400, "over-speed", "The motor turned faster than its limit (6080h).",
     "Lower speed or overshoot; check what drives the load, and encoder and phases."},
    {0x8611, "following error", "The axis lagged behind its demand by more than 6065h for longer than 6066h.",
     "Look for what jams or brakes; lower speed and accelerations, or widen the window."},
    {0x8700, "synchronisation lost", "Set-points or SYNC did not come in the drive's cycle.",
     "Check the master's cycle and 60C2h."},
    {0x9000, "external error", "The input for external errors is active.", "Check the device at that input."},
    {0xFF10, "brake does not hold", "The shaft moved although the brake should hold it.",
     "Check the brake, its supply, and the load that it holds."},
    {0xFF20, "encoder frame", "Telegrams of the encoder are incomplete.", encoder_cable},
    {0xFF21, "encoder turns lost", "The encoder has lost its number of turns.",
     "Switch the supply off and on, then home again; check the encoder's battery."},
    {0xFF22, "encoder turns overflowed", "The turns of the encoder are beyond its range.",
     "Clear the encoder's turns, switch the supply off and on, and home again."},
    {0xFF30, "motor temperature contact", "The motor's temperature contact has opened.", cool},
    {0xFF31, "encoder too hot", "The encoder is hotter than its limit.", cool},
});
static_assert(is_ordered(fault_texts));

}  // namespace servodrome::catalogue::generic402
