#pragma once

// ISMC (CANopen): the maker's own objects, and those whose use differs from CiA 402. 2F10h to 2F18h hold settings that
// the manual describes only for the PC tool.
#include <array>

#include "catalogue/object_texts.hpp"

namespace servodrome::catalogue::ismc {

inline constexpr std::uint8_t any = any_sub;

inline constexpr auto object_texts = std::to_array<ObjectText>({
    {0x1006, any,
     "Time between two SYNC messages in microseconds. Once it is set, two periods without a SYNC are fault 8700h in "
     "mode 8."},
    {0x1016, any,
     "Heartbeat that the drive waits for: node-ID in bits 16 to 23, time in milliseconds in bits 0 to 15. A missing "
     "heartbeat is fault 8130h while the axis is enabled; there is no 6007h."},
    {0x2001, any,
     "Greatest deviation of the distance of two index pulses from whole revolutions, in counts, while the touch probe "
     "measures it (2F18h); more is fault 7320h. 0 switches the check off."},
    {0x2002, any,
     "Order of the motor phases, check it after fault 8620h. Its values are not documented; it is stored only."},
    {0x2004, any,
     "Bit rate of CAN in bit/s: 1000000, 800000, 500000, 250000, 125000, 50000 or 20000. Kept as soon as it is written "
     "and in force after the next restart."},
    {0x2017, any, "Active protections: bit 1 is the I2t protection (fault 8900h). The other bits are not documented."},
    {0x2103, any, "Kind of Hall sensor; must be 0 if fault B104h is reported. It is stored only."},
    {0x2105, any,
     "First setting of the automatic calibration, check it after fault 8620h. Its values are not documented; it is "
     "stored only."},
    {0x2115, any, "Greatest speed forwards in profile torque, in 0.1 % of the rated speed; 0: none."},
    {0x2116, any, "Greatest speed in reverse in profile torque, in 0.1 % of the rated speed; 0: none."},
    {0x2117, any,
     "Shape of the ramp that stops the axis in profile velocity: 0 linear, 3 jerk-limited. Other values are fault "
     "6285h."},
    {0x2137, any,
     "Time in milliseconds for which homing on a hard stop (methods -4 to -1) must have the torque of 2138h before the "
     "motor stops."},
    {0x2138, any,
     "Torque by which homing on a hard stop (methods -4 to -1) recognises the stop, in 0.1 % of the rated torque. A "
     "load that "
     "pulls the axis away from the stop must need less."},
    {0x2200, any, "Monitoring of the velocity: greatest difference between actual velocity and demand, and its time."},
    {0x2200, 0x01,
     "Greatest difference of demand and actual velocity, in counts per second; more is fault 8483h after the time of "
     "sub-index 2. FFFFFFFFh switches it off."},
    {0x2200, 0x02, "Time in milliseconds for which the velocity may differ by more than sub-index 1."},
    {0x2401, any, "Node-ID on CAN, 1 to 127. Kept as soon as it is written and in force after the next restart."},
    {0x2402, any,
     "Second setting of the automatic calibration, check it after fault 8620h. Its values are not documented; it is "
     "stored only."},
    {0x2F10, any,
     "Distance by which the axis backs off from a hard stop before home is set (methods -1 and -2), in counts. 0: home "
     "is at the stop."},
    {0x2F11, any, "Longest time for homing, in milliseconds; beyond it comes fault 628Bh. 0: no limit."},
    {0x2F12, any,
     "Function of each input: 0 nothing, 1 negative limit switch, 2 positive limit switch, 3 home switch, 4 external "
     "alarm (fault 9100h), 5 contact of the motor's temperature (fault 7124h)."},
    {0x2F12, 0x01,
     "Function of DI0, from the factory the negative limit switch: 0 nothing, 1 and 2 limit switches, 3 home, 4 "
     "external alarm, 5 motor temperature."},
    {0x2F12, 0x02,
     "Function of DI1, from the factory the positive limit switch: 0 nothing, 1 and 2 limit switches, 3 home, 4 "
     "external alarm, 5 motor temperature."},
    {0x2F12, 0x03,
     "Function of DI2, from the factory the home switch: 0 nothing, 1 and 2 limit switches, 3 home, 4 external alarm, "
     "5 motor temperature."},
    {0x2F12, 0x04,
     "Function of DI3: 0 nothing, 1 negative and 2 positive limit switch, 3 home switch, 4 external alarm, 5 motor "
     "temperature."},
    {0x2F12, 0x05,
     "Function of DI4: 0 nothing, 1 negative and 2 positive limit switch, 3 home switch, 4 external alarm, 5 motor "
     "temperature."},
    {0x2F12, 0x06,
     "Function of DI5: 0 nothing, 1 negative and 2 positive limit switch, 3 home switch, 4 external alarm, 5 motor "
     "temperature."},
    {0x2F13, any,
     "Outputs that the master may control by 60FEh, one bit each from DO0 in bit 0: those with the function remote "
     "DO."},
    {0x2F14, any, "Ambient temperature in degrees Celsius below which fault 4120h comes."},
    {0x2F15, any,
     "Peak current in 0.1 % of the rated current: the most that flows. Where 2017h has the protection by I2t on, it "
     "may flow for the time of 2F16h."},
    {0x2F16, any, "Time in milliseconds for which the peak current of 2F15h may flow before fault 8900h."},
    {0x2F17, any,
     "Current ratio of the phase sequence detection: fault B102h asks for a greater one. It is stored only."},
    {0x2F18, any,
     "Content of 60BAh: 0 the position at the index, 1 the deviation between index pulses, as from firmware V1.04 on."},
    {0x6041, any,
     "State of the drive, as CiA 402 has it; bit 4 is 1 from switched on. In homing bit 12 comes as soon as home is "
     "found, bit 10 when the motor stands; bit 13 is an error, which is a fault as well."},
    {0x605A, any,
     "Braking of a quick stop: 0 power off, 1 by 6084h, 2 by 6085h, 3 at once by a demand of zero, then power off; 5, "
     "6 and 7 the same as 1 to 3, but the axis is held."},
    {0x605D, any,
     "Braking of a halt (controlword bit 8): 1 by 6084h, 2 by 6085h, 3 at once by a velocity demand of zero. The drive "
     "stays enabled; a move must be started again."},
    {0x605E, any,
     "Braking after a fault: 0 power off, 1 by 6084h, 2 by 6085h, 3 at once by a velocity demand of zero."},
    {0x6060, any,
     "Mode of operation wanted: 0 none, 1 profile position, 3 profile velocity, 4 profile torque, 6 homing, 8 cyclic "
     "synchronous position."},
    {0x6065, any,
     "Distance in counts between demand and actual position beyond which fault 8611h comes after the time of 6066h. "
     "FFFFFFFFh switches it off."},
    {0x606D, any,
     "In profile velocity the target counts as reached within this difference, in counts per second. FFFFh switches it "
     "off."},
    {0x607A, any,
     "Target position in counts: of the next of up to 16 set-points that wait in profile position, and at each cycle "
     "in mode 8. Beyond 607Dh it is fault 8612h."},
    {0x607B, any,
     "Range of positions for rotary axes: beyond sub-index 2 the position continues at sub-index 1. Off where both are "
     "0, and while the software limits 607Dh are on."},
    {0x607D, any,
     "Software limits in counts: a target or position beyond them is fault 8612h; the target is not clipped. Off where "
     "both are 0 or the whole range."},
    {0x6080, any, "Greatest speed of the motor in rpm; 0, the factory's, is no limit."},
    {0x6081, any,
     "Velocity of a move in profile position, in counts per second. 0, the factory's, is fault 6551h when a move "
     "starts."},
    {0x6083, any,
     "Acceleration of the profile modes, in counts per second squared. 0 is fault 6552h when a motion starts."},
    {0x6084, any,
     "Deceleration of the profile modes and of halt, in counts per second squared. 0 is a fault when a motion starts: "
     "6542h in position, 6572h in velocity."},
    {0x6085, any,
     "Deceleration of a quick stop, in counts per second squared. 0 is a fault when a motion starts: 6542h in "
     "position, 6572h in velocity."},
    {0x6086, any,
     "Shape of the ramps: 0 linear, 3 limited by the jerk 60A4h, from standstill only (else fault 628Ch). Other values "
     "are fault 6286h when a motion starts."},
    {0x6087, any,
     "Rate of change of the torque in profile torque, in 0.1 % of the rated torque per second; 0, the factory's, is a "
     "step."},
    {0x6088, any, "Shape of the torque ramp: 0, linear, alone is there; other values are fault 6287h."},
    {0x6098, any,
     "Homing method: -4 to -1 look for a hard stop, 1 to 34 are those of CiA 402, 35 takes the position as it is. "
     "Methods 4 and 5 return to home, other searches for a switch or index stop beyond it."},
    {0x6099, 0x01,
     "Speed of the search for a switch or hard stop, in counts per second. 0, the factory's, is fault 6280h at the "
     "start of homing."},
    {0x6099, 0x02,
     "Speed of the search for the edge or index that determines home, in counts per second. 0, the factory's, is fault "
     "6280h at the start of homing."},
    {0x609A, any,
     "Acceleration and deceleration of homing, in counts per second squared. 0, the factory's, is fault 6280h at the "
     "start."},
    {0x60A4, any, "Jerk where 6086h or 2117h is 3, in counts per second cubed."},
    {0x60B8, any,
     "Touch probe: bit 0 on, 1 continuous, 2 index instead of input, 4 rising and 5 falling edge. Only the rising edge "
     "of the index is caught."},
    {0x60B9, any,
     "State of the touch probe: bit 0 on, 1 rising edge latched, 2 falling edge latched; bit 6 is the source, 0 input, "
     "1 index."},
    {0x60BA, any,
     "Position at the index pulse that the touch probe caught, or with 2F18h the deviation between index pulses; in "
     "counts."},
    {0x60C2, any,
     "Time from one target of mode 8 to the next, 1 to 4 milliseconds in sub-index 1; there is no exponent. 0 is fault "
     "6553h."},
    {0x60FD, any, "Levels of the inputs: DI0 to DI5 in bits 0 to 5, whatever they are for, and the index in bit 6."},
    {0x60FE, 0x01,
     "Wanted levels of DO0 to DO3 in bits 16 to 19; they act where sub-index 2 and the output's function remote DO "
     "(2F13h) allow it."},
    {0x60FE, 0x02, "Mask of the bits 16 to 19 of sub-index 1 that control DO0 to DO3; none from the factory."},
});

}  // namespace servodrome::catalogue::ismc
