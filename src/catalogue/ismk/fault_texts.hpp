#pragma once

// Kinco iSMK: the alarms of the manual's chapter 10 by emergency code (ch. 9.3.3.6).
#include <array>

#include "catalogue/fault_texts.hpp"

namespace servodrome::catalogue::ismk {

// The bit in which an alarm appears (products/ismk/faults.hpp).
inline constexpr std::uint16_t state(unsigned bit) { return static_cast<std::uint16_t>(bit); }
inline constexpr std::uint16_t state_2(unsigned bit) { return static_cast<std::uint16_t>(16 + bit); }
inline constexpr std::uint16_t extension(unsigned bit) { return static_cast<std::uint16_t>(32 + bit); }

inline constexpr std::string_view motor_cable =
    "Check the motor cable and the motor. Repeated resets may damage the drive.";
inline constexpr std::string_view encoder_cable = "Check the encoder's cable, shield and type; then reset.";
inline constexpr std::string_view replace =
    "Switch the supply off and on; if it comes back, initialise and store the parameters, then replace the drive.";
inline constexpr std::string_view resistor = "Lower decelerations or the load; check the resistor's value and wiring.";

inline constexpr auto fault_texts = std::to_array<FaultText>({
    {0x2320, "over-current", "The output current is above its limit: power stage or motor shorted.", motor_cable,
     state(7)},
    {0x2321, "current beyond measuring",
     "The current converter is at its limit, because the current is out of control.", motor_cable, extension(4)},
    {0x2350, "I2t of motor or drive", "The load rate of motor or drive (2FF0h sub 10h, 11h) reached 100 %.",
     "Lower load, accelerations or duty cycle; look for what jams or a brake that drags.", state(11)},
    {0x3210, "over-voltage", "The DC bus is above 6510h sub 9: the supply is too high, or braking feeds energy back.",
     "Check the supply; lower decelerations, or fit a brake unit.", state(5)},
    {0x3220, "under-voltage", "The DC bus is below 6510h sub 7: the supply is off, too low, or drops under load.",
     "Switch the supply on; check its current limit and cable.", state(6)},
    {0x4210, "drive too hot", "The power stage is at its alarm temperature.",
     "Improve cooling or lower the load; let it cool down.", state(4)},
    {0x4310, "motor too hot",
     "The winding (6410h sub 19h) is above 6410h sub 18h, or the input for motor errors is active.",
     "Let it cool down; lower the load; check the sensor.", state(13)},
    {0x5112, "logic supply low", "The logic supply is below its limit.", "Check the supply of the logic.", state(10)},
    {0x5210, "current sensor", "The zero of the current sensor has moved, or its signal ripples too much.", replace,
     state_2(0)},
    {0x5210, "current sensor's zero not recorded",
     "The drive could not record the zero of the current sensor at power-on.", replace, extension(0)},
    {0x5441, "negative limit",
     "The axis reached the negative limit switch after homing, and 2010h sub 19h makes that an alarm.",
     "Move back in the positive direction after the reset; 2010h sub 19h = 1 only stops.", state_2(10)},
    {0x5442, "positive limit",
     "The axis reached the positive limit switch after homing, and 2010h sub 19h makes that an alarm.",
     "Move back in the negative direction after the reset; 2010h sub 19h = 1 only stops.", state_2(9)},
    {0x5443, "external enable missing", "An input has the function pre-enable and is not active.",
     "Activate the input, or remove the function from it.", state_2(8)},
    {0x6010, "watchdog", "The drive's program was late.", replace, state_2(1)},
    {0x6011, "wrong interrupt", "The drive's program received an impossible interrupt.", replace, state_2(2)},
    {0x6012, "internal SPI", "A link inside of the drive failed.", replace, state_2(11)},
    {0x6310, "EEPROM", "Stored data were damaged when they were read at power-on.",
     "Initialise the control parameters, store them, and restart.", state(15)},
    {0x6320, "motor not configured", "No data of a motor are stored, or the connected motor is not the stored one.",
     "Set the motor's type, store the motor data, and restart.", state_2(4)},
    {0x6321, "motor phase missing", "U, V or W is not connected.", "Check the motor's plug and cable.", extension(3)},
    {0x7110, "brake resistor", "The brake resistor is overloaded.", resistor, state(8)},
    {0x7111, "internal brake resistor too hot", "The internal brake resistor took too much power.", resistor,
     extension(1)},
    {0x7112, "internal brake unit shorted", "The internal brake unit is broken.", "Replace the drive.", extension(2)},
    {0x7306, "main encoder's index", "The index signal of the main encoder is missing or wrong.",
     "Check its wiring; 250Ah sub 1 = 0 switches the check off.", state_2(15)},
    {0x7320, "encoder turns lost", "The encoder's turns are not valid: its battery was empty or not connected.",
     "Write 10 to 2690h sub 0, reset, and home again; check the battery.", state(2)},
    {0x7330, "encoder checksum", "Telegrams of the encoder arrive damaged: motor type, wiring or interference.",
     encoder_cable, state(3)},
    {0x7331, "encoder not connected", "The encoder does not answer.", encoder_cable, state(1)},
    {0x7331, "encoder telegrams break off", "The encoder is not connected, or answers too late.", encoder_cable,
     state(14)},
    {0x7382, "main encoder", "The main encoder is not connected.", "Check its cable and plug.", state_2(14)},
    {0x7400, "controller", "The firmware is not for this controller.", "Update the firmware, or replace the drive.",
     state_2(3)},
    {0x8100, "CAN connection lost", "Guarding or heartbeat is missing, and 6007h = 1 makes that an alarm.",
     "Check that the master runs; reset and enable again.", state_2(12)},
    {0x81FF, "service time-out", "The services of the bus are missing.", "Check that the master runs.", extension(12)},
    {0x8611, "following error", "The position differs from its demand by more than 6065h.",
     "Look for what jams or brakes; check gains, torque limit and 6065h.", state(9)},
    {0x8A80, "pulse frequency", "The frequency of external pulses is too high.",
     "Lower it; above 600 kHz raise 2508h sub 8.", state(12)},
    {0x8A81, "encoders count against each other", "Main and motor encoder count in opposite directions.",
     "Reverse the direction of the main encoder (250Ah).", state_2(13)},
});
static_assert(is_ordered(fault_texts));

}  // namespace servodrome::catalogue::ismk
