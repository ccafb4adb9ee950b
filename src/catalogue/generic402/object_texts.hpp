#pragma once

// The reference drive's own objects (src/products/generic402).
#include <array>

#include "catalogue/object_texts.hpp"

namespace servodrome::catalogue::generic402 {

inline constexpr std::uint8_t any = any_sub;

inline constexpr auto object_texts = std::to_array<ObjectText>({
    {0x2010, any, "Gains of the position and velocity loop, filters and notches. Values of 0 are computed from 2011h."},
    {0x2010, 0x01, "Gain of the position loop: speed per position error, in 0.01/s. 0: computed from 2011h."},
    {0x2010, 0x02,
     "Proportional gain of the velocity loop: current per speed error, in uA s/rad. 0: computed from 2011h."},
    {0x2010, 0x03, "Integral gain of the velocity loop, in uA/rad. 0: computed from 2011h."},
    {0x2010, 0x04,
     "Velocity feed forward: share of the commanded speed that is added after the position loop; 1000 is the whole "
     "speed."},
    {0x2010, 0x05,
     "Acceleration feed forward: share of the torque for the commanded acceleration that is added after the velocity "
     "loop; 1000 is the torque by the inertia ratio 2012h."},
    {0x2010, 0x06, "Corner of the low pass on the measured speed, in Hz. 0: computed from 2011h."},
    {0x2010, 0x07, "Corner of the low pass on the torque command, in Hz. 0: computed from 2011h."},
    {0x2010, 0x08, "Frequency that the first notch removes from the torque command, in Hz; 0 switches it off."},
    {0x2010, 0x09, "Width of the first notch in Hz, around its frequency."},
    {0x2010, 0x0A, "Gain of the first notch at its frequency: 0 removes it, 1000 leaves it unchanged."},
    {0x2010, 0x0B, "Frequency that the second notch removes from the torque command, in Hz; 0 switches it off."},
    {0x2010, 0x0C, "Width of the second notch in Hz, around its frequency."},
    {0x2010, 0x0D, "Gain of the second notch at its frequency: 0 removes it, 1000 leaves it unchanged."},
    {0x2011, any, "Bandwidths from which gains of 0 in 2010h are computed."},
    {0x2011, 0x01, "Bandwidth of the current loop in Hz."},
    {0x2011, 0x02, "Bandwidth of the velocity loop in Hz, from which gains of 0 in 2010h are computed."},
    {0x2012, any, "Inertia of motor and load as a share of the motor's: 1000 is the motor alone."},
    {0x2013, any,
     "Greatest current against the magnet's flux, for speeds that the voltage does not allow otherwise; 0: no field "
     "weakening."},
    {0x2020, any, "Delays of a holding brake."},
    {0x2020, 0x01, "Milliseconds from motor power on to the first motion, in which the brake opens."},
    {0x2020, 0x02, "Milliseconds for which the motor still holds after the command to close the brake."},
    {0x2030, any, "Function of each digital input; several inputs may have the same function."},
    {0x2031, any, "Polarity of the inputs, bit n for input n: 1 means active when open."},
    {0x2040, any, "Limits of the supervision; beyond one of them the drive goes to fault."},
    {0x2040, 0x01, "Supply voltage in V from which on the drive faults."},
    {0x2040, 0x02, "Supply voltage in V below which the drive faults while the motor has power."},
    {0x2040, 0x03, "Temperature of the motor in degrees Celsius at which the drive faults."},
    {0x2040, 0x04, "Temperature of the power stage in degrees Celsius at which the drive faults."},
    {0x2040, 0x05,
     "Speed in rpm beyond which the drive faults; 0: 1.2 times the motor's greatest, or 6080h where that is lower."},
    {0x2041, any, "Reaction to overload or heat: 0 fault at the limit, 1 reduction of the torque before the limit."},
    {0x2050, any, "Homing against a hard stop (methods -1 to -4), and the time limit of every homing."},
    {0x2050, 0x01,
     "Torque by which homing recognises a hard stop, in 0.1 % of the rated torque. A load that pulls the axis away "
     "from the stop must need less."},
    {0x2050, 0x02, "Milliseconds that the torque has to last at the hard stop."},
    {0x2050, 0x03, "Increments that the axis goes back from the hard stop."},
    {0x2050, 0x04, "Milliseconds after which a homing that has not ended is an error; 0: no limit."},
    {0x2060, any, "Used share of the I2t reserve; at 100 % the drive faults, with the reaction of 605Eh."},
    {0x2F00, any, "Node-ID after the next restart; stored with the parameters."},
    {0x2F01, any, "CAN bit rate after the next restart; stored with the parameters."},
    {0x2F10, any, "1 KiB for the user: any data can be written in one transfer and read back."},
    {0x2F20, any, "The RS485 port for Modbus, in force after a restart."},
    {0x2F20, 0x01, "Station of the drive on the RS485 line; 0: the same as the node-ID."},
    {0x2F20, 0x02, "Bits per second of the RS485 port."},
    {0x2F20, 0x03, "Parity of the RS485 port: 0 none, 1 even, 2 odd."},
    {0x2F20, 0x04, "Stop bits of the RS485 port."},
    {0x60F8, any,
     "Greatest difference between target and shown speed in profile velocity; beyond it bit 13 of the statusword is "
     "set."},
});

}  // namespace servodrome::catalogue::generic402
