#pragma once

// ESTUN ProNet: the alarms (manual, ch. 3.5, A 69 in ch. 7.5.4). The manual gives no causes; the causes in this table
// are those of the simulated drive.
#include <array>

#include "catalogue/fault_texts.hpp"

namespace servodrome::catalogue::pronet {

inline constexpr std::string_view replace = "Switch the supply off and on; if it comes back, replace the drive.";
inline constexpr std::string_view encoder_cable = "Check encoder cable, shield and plug; then reset.";
inline constexpr std::string_view bus_cable = "Check cable, termination, bit rate (Pn703) and the load of the bus.";

inline constexpr auto fault_texts = std::to_array<FaultText>({
    {0x2310, "over-current",
     "The current of a phase or of the DC link is too high: short circuit, earth fault or overload.",
     "Check motor cable and motor; if it stays without motor, replace the drive."},
    {0x3100, "mains went away for a moment", "The mains failed for longer than the drive can bridge.",
     "Check mains, contactor and fuses."},
    {0x3110, "over-voltage", "The mains are too high, or braking feeds back more energy than the drive absorbs.",
     "Check mains and regenerative resistor; lower decelerations."},
    {0x3120, "under-voltage", "The mains are too low or off.", "Check mains, contactor and fuses."},
    {0x5080, "RAM", "The drive's memory failed its test.", replace},
    {0x5210, "current measurement", "The converter that measures the currents has failed.", replace},
    {0x5420, "regenerative resistor overloaded", "Braking feeds back more energy than the resistor absorbs.",
     "Lower decelerations or duty cycle, or fit a larger resistor."},
    {0x5421, "regenerative resistor broken", "The resistor or its transistor is open or shorted.",
     "Check the resistor and its wiring."},
    {0x5581, "parameters damaged", "The checksum of the stored parameters is wrong.",
     "Restore the factory's parameters, and set yours again."},
    {0x5582, "electronic gear", "Pn201 and Pn202, or the factors 6093h, give no valid ratio.",
     "Set them to a ratio within the drive's range."},
    {0x5583, "motor or drive type", "Motor and drive do not match.",
     "Check the model of both; set the motor's parameters."},
    {0x6100, "unknown alarm", "The drive has an alarm without a code.", replace},
    {0x6120, "PDO mapping", "A mapping cannot be used.",
     "Write 1600h or 1A00h and following again, with the objects and lengths of the drive."},
    {0x6300, "CAN settings", "Node address (Pn704) or bit rate (Pn703) are not valid.",
     "Set both, and switch the supply off and on."},
    {0x6320, "homing cannot start",
     "The method needs an index, which this encoder does not have, or a homing speed or the acceleration is 0.",
     "Choose method 17 to 20 or 35, or set 6099h and 609Ah."},
    {0x7303, "serial encoder", "The encoder does not answer, or its telegrams, turns or counts are wrong.",
     encoder_cable},
    {0x7305, "incremental encoder", "Encoder or Hall signals are missing or wrong.", encoder_cable},
    {0x7380, "resolver", "The resolver's signals are missing or wrong.", encoder_cable},
    {0x8100, "CAN communication", "The CAN controller failed.", bus_cable},
    {0x8110, "CAN overrun", "Messages came faster than the drive could process them.", bus_cable},
    {0x8120, "CAN error passive", "Many frames were damaged.", bus_cable},
    {0x8130, "heartbeat", "The node that 1016h monitors sends no more heartbeats.",
     "Check that the master runs, and the time in 1016h."},
    {0x8140, "CAN bus off", "Too many frames were damaged, so the drive has gone bus-off.", bus_cable},
    {0x8169, "interpolation too late", "No synchronised set-point came within the next SYNC period.",
     "Compare the SYNC's period with 60C2h and 2105h, and check that the master sends a set-point in each period.",
     0x69},
    {0x8200, "CAN message length", "The length of a message did not match its service.",
     "Check what the master sends."},
    {0x8210, "PDO too short", "A PDO was shorter than its mapping.",
     "Make the master's PDO as long as the mapping (1600h and following)."},
    {0x8311, "overload", "The motor carried more than its rated load for too long.",
     "Lower load, accelerations or duty cycle; look for what jams or a brake that drags."},
    {0x8480, "over-speed", "The motor turned faster than it may.",
     "Lower speed or overshoot; check encoder, phases, and forces that drive the load."},
    {0x8681, "forward run prohibited (POT)", "The positive limit switch is active.",
     "Move back in the negative direction; without a switch, set the input's function."},
    {0x8682, "reverse run prohibited (NOT)", "The negative limit switch is active.",
     "Move back in the positive direction; without a switch, set the input's function."},
});
static_assert(is_ordered(fault_texts));

}  // namespace servodrome::catalogue::pronet
