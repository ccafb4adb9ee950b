#pragma once

// ISMC: the chapter on troubleshooting (manual, ch. 5), in our own words.
#include <array>

#include "catalogue/fault_texts.hpp"

namespace servodrome::catalogue::ismc {

inline constexpr std::string_view motor_cable =
    "Check the motor cable's insulation and the motor; lower the load. If it stays without motor, replace the drive.";
inline constexpr std::string_view cool =
    "Cool the cabinet, clean the fan's way, lower the load; let it cool down before the reset.";
inline constexpr std::string_view encoder_cable = "Check the encoder's parameters, cable, shield and plug.";
inline constexpr std::string_view restart = "Switch the supply off and on; if it comes back, replace the encoder.";
inline constexpr std::string_view tune =
    "Check encoder wiring, gains and load; look for what jams, and widen the window if it is too narrow.";
inline constexpr std::string_view angle =
    "Check encoder and motor wiring, free the shaft from its load, and identify the angle again.";

inline constexpr auto fault_texts = std::to_array<FaultText>({
    {0x2230, "DC bus over-current",
     "DC bus too high, a short circuit outside, a failed encoder, or a broken part inside.", motor_cable},
    {0x2310, "over-current, phase U",
     "Phase U is shorted, overloaded or badly insulated, or its current is measured wrong.", motor_cable},
    {0x2311, "over-current, phase V",
     "Phase V is shorted, overloaded or badly insulated, or its current is measured wrong.", motor_cable},
    {0x2320, "short circuit",
     "A short circuit at the output, DC bus too high, a failed encoder, or a broken part inside.", motor_cable},
    {0x3130, "motor phase missing", "U, V or W is open.", "Check the motor's plug and cable."},
    {0x3210, "over-voltage",
     "Braking feeds back more energy than the brake circuit absorbs, or the power module is broken.",
     "Fit a brake resistor that is large enough, or lower decelerations."},
    {0x3220, "under-voltage", "The supply is low or off, the load high, or the DC bus badly insulated.",
     "Measure the supply under load; check its cable and the insulation."},
    {0x3221, "supply of the PWM drivers", "The drivers' +15 V is too low.", "Check the +24 V of the control supply."},
    {0x4110, "ambient too hot", "Surroundings too hot, cooling failed, or the sensor is broken.", cool},
    {0x4120, "ambient too cold", "Surroundings below the smallest ambient temperature, or the sensor is broken.",
     "Warm the cabinet, or set a lower limit."},
    {0x4310, "power module too hot", "Surroundings too hot, cooling failed, overload, or the sensor is broken.", cool},
    {0x5530, "stored parameters lost",
     "What was stored is damaged, is another product's, or cannot be read: these are factory values.",
     "Set and store the parameters, or restore the defaults (1011h); look at the memory's file."},
    {0x6180, "profile with a negative time", "Position, speed and accelerations do not match each other.",
     "Check 607Ah, 6081h, 6083h and 6084h."},
    {0x6181, "end velocity above the first one", "The stop velocity is not 0.", "Set the end velocity to 0."},
    {0x6182, "values missing for multi-point motion",
     "Positions, speeds or accelerations of a continuous motion are not set.", "Set them all before the start."},
    {0x6184, "homing lost its way",
     "The homing went from one step to a step that cannot follow it, or on its way to a hard stop a "
     "load drove the axis back.",
     "Home again."},
    {0x6280, "a profile value is 0", "A homing speed, the homing acceleration or another value of a profile is 0.",
     "Set 6099h and 609Ah, or what the mode needs, to more than 0."},
    {0x6281, "end velocity too high", "The end velocity is above the profile velocity.",
     "Lower the end velocity or raise 6081h."},
    {0x6282, "end velocity out of reach", "The target is too close to reach the end velocity.",
     "Lower the end velocity, or move further."},
    {0x6283, "software limits wrong", "607Dh has its minimum above its maximum, or lies outside of 607Bh.",
     "Set 607Dh sub 1 below sub 2 and within 607Bh, or both to 0."},
    {0x6284, "position range wrong", "607Bh has its minimum above its maximum.",
     "Set 607Bh sub 1 below sub 2, or both to 0."},
    {0x6285, "velocity ramp unknown", "2117h names a curve that the drive does not have.", "Set 2117h to 0."},
    {0x6286, "motion profile unknown", "6086h names a curve that the drive does not have.",
     "Set 6086h to 0 (linear) or 3 (jerk-limited)."},
    {0x6287, "torque profile unknown", "6088h names a curve that the drive does not have.", "Set 6088h to 0."},
    {0x6288, "homing met a wrong limit switch", "The axis reached a limit switch that the method does not use.",
     "Check the switches' wiring and the method in 6098h."},
    {0x6289, "homing method unknown", "6098h names a method that the drive does not have.", "Choose another method."},
    {0x628B, "homing took too long", "The zero point was not found in time.",
     "Check that switch and index signal come, and the homing speeds."},
    {0x628C, "jerk-limited start in motion", "A jerk-limited profile was commanded while the motor moves.",
     "Wait until the axis stands, or set 6086h to 0."},
    {0x6542, "deceleration 0 in position mode", "6084h or 6085h is 0.", "Set both to more than 0."},
    {0x6551, "profile velocity 0", "6081h is 0 in position mode.", "Set 6081h to more than 0."},
    {0x6552, "acceleration 0", "6083h or 6084h is 0.", "Set both to more than 0."},
    {0x6553, "interpolation period 0", "60C2h sub 1 is 0.", "Set it to the master's cycle."},
    {0x6572, "deceleration 0 in velocity mode", "6084h or 6085h is 0.", "Set both to more than 0."},
    {0x7124, "motor too hot", "The temperature sensor on a digital input reports an overheated motor.", cool},
    {0x7320, "index pulses apart", "Two index pulses were not one revolution apart, by more than 2001h.",
     "Check encoder wiring and coupling; check 2001h."},
    {0x7380, "encoder connection", "The encoder does not answer: parameters, cable, or broken.", encoder_cable},
    {0x7383, "encoder turns wrong", "The encoder has lost its number of turns.", restart},
    {0x7384, "encoder too hot", "The encoder is above 95 degC.", cool},
    {0x7385, "encoder counts wrong", "The encoder reports an error of its own.", restart},
    {0x7389, "encoder turns overflowed", "The encoder counted more turns than it can.",
     "Clear the turns, then switch the supply off and on; if it comes back, replace the encoder."},
    {0x738A, "encoder checksum", "Telegrams of the encoder arrive damaged, or the parameters of the encoder are wrong.",
     encoder_cable},
    {0x738B, "encoder telegrams break off", "The encoder's telegrams do not end as they should.", restart},
    {0x738C, "Hall signals missing", "The Hall signals are disconnected.", "Check the Hall signals' wiring."},
    {0x8130, "master lost", "The master's heartbeat or guarding is missing.",
     "Check that the master runs and 1016h, or 100Ch and 100Dh; reset and enable again."},
    {0x8482, "over-speed", "The motor ran away or overshot, the commanded speed is too high, or the encoder is faulty.",
     "Check the speed commands, the encoder, the phases, and forces that drive the load."},
    {0x8483, "velocity error", "The velocity differs from its demand by more than 2200h allows.", tune},
    {0x8611, "following error", "The position differs from its demand by more than 6065h for longer than 6066h.", tune},
    {0x8612, "beyond the position range", "Target or position are beyond the position limit.",
     "Move back into the range; check limit switches, 607Bh and 607Dh."},
    {0x8620, "calibration failed", "The automatic calibration at enabling failed.",
     "Check 2105h, 2402h and 2002h, and calibrate again."},
    {0x8700, "synchronisation lost", "The SYNC is missing or came at the wrong time.",
     "Check the SYNC's period against 60C2h and 1006h; the drive needs a restart."},
    {0x8900, "I2t", "The load was above the I2t threshold for too long.",
     "Lower load, accelerations or duty cycle; bit 1 of 2017h switches this monitor."},
    {0x8901, "not calibrated", "The drive was enabled before the rotor's angle was identified.",
     "Identify the angle first."},
    {0x9100, "external alarm", "The digital input for alarms is active.", "Look at the device on that input."},
    {0xB010, "position unsteady in angle identification", "The encoder wiring is wrong, or the load turns the motor.",
     angle},
    {0xB020, "rotor stands still in angle identification",
     "The current is too small, the load is too high, or the wiring is wrong.", angle},
    {0xB030, "rotor moves too far in angle identification", "The current is too high, or phases and load are wrong.",
     angle},
    {0xB040, "angle identification took too long", "The drive's program did not complete the identification.",
     "Switch the supply off and on, and identify again."},
    {0xB102, "motor hardly turns in phase detection",
     "The encoder wiring is wrong, load or friction are too high, or the current is set too low.", angle},
    {0xB104, "Hall state impossible", "The wiring of the Hall signals, or the Hall model, is wrong.",
     "Check their wiring; with 2103h = 0 the drive does not use them."},
});
static_assert(is_ordered(fault_texts));

}  // namespace servodrome::catalogue::ismc
