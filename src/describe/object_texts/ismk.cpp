// Kinco iSMK: objects of the maker's own, from the chapters of its manual on inputs and outputs, loops, storage and
// alarms.
#include <array>

#include "describe/object_texts/tables.hpp"

namespace servodrome::describe {
namespace {

constexpr std::uint8_t any = any_sub;

constexpr auto texts = std::to_array<ObjectText>({
    {0x2010, any, "The terminals: what each input and output is for, their sense, and levels that are simulated."},
    {0x2010, 0x01, "Sense of the inputs, bit n for input n + 1: 1 is normally open, 0 normally closed."},
    {0x2010, 0x02,
     "Inputs that are taken for active whatever their wire says, one bit each: for commissioning without wiring."},
    {0x2010, 0x0A, "Levels of the inputs at the terminals, one bit each."},
    {0x2010, 0x14, "Levels of the outputs at the terminals, one bit each."},
    {0x2020, any, "Positions, speeds, modes and controlword that inputs can choose, for a drive without a master."},
    {0x2340, any, "Further gain sets of the loops, and automatic tuning."},
    {0x2340, 0x10,
     "What automatic tuning does: bit 0 on, 1 adapts the velocity gain, 2 the acceleration feed forward, 4 and 5 keep "
     "it from one direction, 7 uses the friction."},
    {0x250B, any, "Frequencies of the notch filters in the torque command."},
    {0x2601, any, "Active alarms, one bit each; `faults` of the axis explains them."},
    {0x2602, any, "Active alarms of the second word, one bit each; `faults` of the axis explains them."},
    {0x2605, any, "Which alarms are watched, and which the drive's own history keeps with the motor on and off."},
    {0x2FF0, any, "Storage, and parameters in units for people."},
    {0x2FF0, 0x01, "1 stores the control parameters, 10 brings their factory values back; not those of the motor."},
    {0x2FF0, 0x03, "1 stores the motor's parameters."},
    {0x2FF0, 0x0A,
     "Bandwidth of the velocity loop in Hz; writing it works the velocity gain out anew, from the inertia ratio."},
    {0x6099, 0x03, "1: the drive homes by itself when it is enabled first after power-on."},
    {0x6099, 0x04, "Greatest current while homing."},
    {0x6099, 0x05,
     "Where homing ends: 0 runs on to the offset and shows 0 there, 1 stays at home and shows the offset."},
    {0x6099, 0x06,
     "Index pulses so close behind the edge of a switch are passed by: 0 none, 1 chosen by the drive, 2 half a "
     "revolution."},
});

}  // namespace

std::span<const ObjectText> ismk_object_texts() { return texts; }

}  // namespace servodrome::describe
