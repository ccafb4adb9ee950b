#pragma once

// JMC EC: panel parameters, monitoring items and functions of the service port, and profile objects that these drives
// use in their own way. From the chapters of the manual on parameters, objects, modes and homing.
#include <array>

#include "catalogue/object_texts.hpp"

namespace servodrome::catalogue::jmc_ec {

inline constexpr std::uint8_t any = any_sub;

inline constexpr auto object_texts = std::to_array<ObjectText>({
    {0x1600, any,
     "Objects of the first PDO from the master: of cyclic position as delivered. Changed in Pre-Operational only, back "
     "to factory values at power-on; unused entries are FFFFFFFFh."},
    {0x1601, any,
     "Objects of the second PDO from the master: with a target velocity as delivered. Changed in Pre-Operational only; "
     "unused entries are FFFFFFFFh."},
    {0x1602, any,
     "Objects of the third PDO from the master: torque, profile speed and ramps as delivered. Changed in "
     "Pre-Operational only; unused entries are FFFFFFFFh."},
    {0x1603, any,
     "Objects of the fourth PDO from the master: those of homing as delivered. Changed in Pre-Operational only; unused "
     "entries are FFFFFFFFh."},
    {0x1A00, any,
     "Objects of the first PDO to the master: state, position, touch probes and inputs as delivered. Changed in "
     "Pre-Operational only; unused entries are FFFFFFFFh."},
    {0x1A01, any,
     "Objects of the second PDO to the master: mode, velocity and following error as delivered. Changed in "
     "Pre-Operational only; unused entries are FFFFFFFFh."},
    {0x1A02, any,
     "Objects of the third PDO to the master: error code and torque as delivered. Changed in Pre-Operational only; "
     "unused entries are FFFFFFFFh."},
    {0x1A03, any,
     "Objects of the fourth PDO to the master: none as delivered. Changed in Pre-Operational only; unused entries are "
     "FFFFFFFFh."},
    {0x1C12, any,
     "Assigned PDOs from the master: only 1600h as delivered. If two of them contain the same object, the later one "
     "applies. It can be changed only in Pre-Operational."},
    {0x2000, any,
     "P00, motor and drive: P00-nn is sub-index nn + 1, for the service port only. Set at the factory; what is written "
     "acts from the next power-on."},
    {0x2000, 0x01, "P00-00, number of the motor; with 0, as delivered, P00-01 to P00-17 describe the motor."},
    {0x2000, 0x02, "P00-01, rated speed of the motor in rpm. Set at the factory."},
    {0x2000, 0x03, "P00-02, rated torque of the motor in 0.01 Nm. Set at the factory."},
    {0x2000, 0x04, "P00-03, rated current of the motor in 0.01 A. Set at the factory."},
    {0x2000, 0x05, "P00-04, inertia of the rotor in 0.01 kg cm2: what the ratio in P01-04 refers to."},
    {0x2000, 0x06, "P00-05, pole pairs of the motor. Set at the factory."},
    {0x2000, 0x0B,
     "P00-10, lines of the encoder per revolution; a revolution has four times as many counts. Set at the factory."},
    {0x2000, 0x0C, "P00-11, electrical angle at which the encoder's index pulse comes. Set at the factory."},
    {0x2000, 0x0D, "P00-12, first of six initial angles of the rotor, in degrees. Set at the factory."},
    {0x2000, 0x0E, "P00-13, second of six initial angles of the rotor, in degrees. Set at the factory."},
    {0x2000, 0x0F, "P00-14, third of six initial angles of the rotor, in degrees. Set at the factory."},
    {0x2000, 0x10, "P00-15, fourth of six initial angles of the rotor, in degrees. Set at the factory."},
    {0x2000, 0x11, "P00-16, fifth of six initial angles of the rotor, in degrees. Set at the factory."},
    {0x2000, 0x12, "P00-17, last of six initial angles of the rotor, in degrees. Set at the factory."},
    {0x2000, 0x16, "P00-21, bit rate of the RS232 port to the PC: 0 is 9600, 1 19200, 2 57600, 3 115200 bit/s."},
    {0x2000, 0x18, "P00-23, address of the drive on the service port."},
    {0x2000, 0x19,
     "P00-24, bit rate of Modbus in the series' RS485 drives. Kept without effect; the meaning of the codes is not "
     "documented."},
    {0x2000, 0x1A,
     "P00-25, parity and stop bits of RS485: 0 none and 2, 1 even and 1, 2 odd and 1, 3 none and 1. Without effect on "
     "the RS232 port, which is 8N1."},
    {0x2000, 0x1B, "P00-26, how long in milliseconds the drive waits before it answers on the service port."},
    {0x2000, 0x1C,
     "P00-27, bit rate of CANopen in the series' CAN drives. Kept without effect; the meaning of the codes is not "
     "documented."},
    {0x2000, 0x2B, "P00-42, voltage of the supply in volts above which the drive reports overvoltage."},
    {0x2001, any, "P01, main control: P01-nn is sub-index nn + 1, for the service port only. Acts at once."},
    {0x2001, 0x02,
     "P01-01: 0 position, 1 speed, 2 torque, 3 speed/torque, 4 position/speed, 5 position/torque, 6 full closed loop. "
     "Without effect: on the bus 6060h chooses."},
    {0x2001, 0x03,
     "P01-02: 0 gains by hand; 1 gains and torque filter come from the level in P01-03; 2 as 1, with speed "
     "feed-forward "
     "fixed at 30 % and 0.5 ms besides."},
    {0x2001, 0x04,
     "P01-03, how stiff the axis is held, 0 to 31 from soft to stiff: chooses one of 32 gain sets while P01-02 is 1 "
     "or 2."},
    {0x2001, 0x05,
     "P01-04, inertia of the load divided by the motor's, in hundredths. Set it before the gains; the result of "
     "AF-J-L in 200Eh may be written here."},
    {0x2001, 0x1F,
     "P01-30, time in milliseconds for the brake: targets wait this time after enabling; if the motor is switched off "
     "at rest, its power goes off this time after the brake has closed."},
    {0x2001, 0x20,
     "P01-31: if the motor is switched off while it turns, the brake closes below this speed in rpm, or after P01-32."},
    {0x2001, 0x21,
     "P01-32: longest time in milliseconds that the brake waits for the speed of P01-31 when a turning motor is "
     "switched off."},
    {0x2002, any,
     "P02, gains: P02-nn is sub-index nn + 1, for the service port only. Tune the speed loop first, then the position "
     "loop. Acts at once."},
    {0x2002, 0x01,
     "P02-00, gain of the position loop in the first set (at rest), in 0.1/s. Higher follows more closely, too high "
     "overshoots and vibrates."},
    {0x2002, 0x02,
     "P02-01, gain of the position loop in the second set (in motion), in 0.1/s. Raise it as far as nothing vibrates."},
    {0x2002, 0x04,
     "P02-03, share of the commanded speed that bypasses the position loop, in 0.1 %. More lessens the lag, too much "
     "overshoots."},
    {0x2002, 0x05, "P02-04, time constant of the filter behind P02-03, in 0.01 ms. Smoother, but later."},
    {0x2002, 0x0B,
     "P02-10, gain of the speed loop in the first set, in 0.1 Hz. Raise it as far as nothing vibrates; it counts on "
     "the inertia of P01-04."},
    {0x2002, 0x0C,
     "P02-11, integral time of the speed loop in the first set, in 0.1 ms. Shorter is stiffer, too short vibrates."},
    {0x2002, 0x0D,
     "P02-12, kind of the speed loop in the first set, in 0.1 %: 1000 is plain PI and quick, lower values let the "
     "integral dominate, slower but firmer against slow disturbances."},
    {0x2002, 0x0E, "P02-13, gain of the speed loop in the second set (in motion), in 0.1 Hz."},
    {0x2002, 0x0F, "P02-14, integral time of the speed loop in the second set, in 0.1 ms."},
    {0x2002, 0x10, "P02-15, as P02-12 for the second set: 1000 is plain PI, lower values let the integral dominate."},
    {0x2002, 0x14,
     "P02-19, share in percent of the torque for the commanded acceleration that is given at once, without waiting for "
     "the speed loop. Needs a true P01-04."},
    {0x2002, 0x15, "P02-20, time constant of the filter behind P02-19, in 0.01 ms."},
    {0x2002, 0x1F,
     "P02-30, second gain set when: 0 never, 1 always, 2 by input, 3 torque, 4 speed change, 5 speed command, 6 "
     "deviation, 7 position command, 8 not in position, 9 actual speed, 10 is 7 then 9."},
    {0x2002, 0x20,
     "P02-31, level beyond which P02-30 takes the second set. 1000 is 25 % of rated torque or 200 rpm; in positions "
     "131072 is one revolution."},
    {0x2002, 0x21, "P02-32, hysteresis around the level of P02-31, in its units."},
    {0x2002, 0x22, "P02-33, how long in 0.1 ms the condition must be over before the first set comes back."},
    {0x2002, 0x23, "P02-34, time in 0.1 ms over which the position gain glides from one set to the other."},
    {0x2002, 0x2A,
     "P02-41, threshold of a mode switch, in the units of P02-31. Kept without effect: the manual does not say what it "
     "switches."},
    {0x2002, 0x33,
     "P02-50, torque in 0.1 % of rated added in the position modes: holds the weight of a vertical axis."},
    {0x2002, 0x34, "P02-51, torque in 0.1 % of rated added in forward motion in the position modes, against friction."},
    {0x2002, 0x35,
     "P02-52, torque in 0.1 % of rated added in reverse motion in the position modes, against friction; with its own "
     "sign."},
    {0x2003, any,
     "P03, position: P03-nn is sub-index nn + 1, for the service port only. P03-09 to P03-11 act from power-on, the "
     "others at once."},
    {0x2003, 0x01, "P03-00, where positions come from: 0 pulses, 1 communication. Without effect: the bus commands."},
    {0x2003, 0x04, "P03-03, sense of command pulses: 0 normal, 1 inverted. Without effect: there is no pulse input."},
    {0x2003, 0x05,
     "P03-04, filter of the pulse input: 0 is 0.1, 1 0.4, 2 0.8, 3 1.6 microseconds. Without effect: there is no pulse "
     "input."},
    {0x2003, 0x06,
     "P03-05, when the in-position output comes: 0 within P03-06; 1 besides, the command is at its end; 2 besides, the "
     "smoothed command is too."},
    {0x2003, 0x07, "P03-06, position deviation in encoder counts below which the axis counts as in position."},
    {0x2003, 0x0A,
     "P03-09, command pulses per motor revolution; 0 leaves it to P03-10 and P03-11. Without effect: the bus has "
     "608Fh, "
     "6091h and 6092h."},
    {0x2003, 0x0B, "P03-10, numerator of the gear for command pulses. Without effect: the bus has its own gear."},
    {0x2003, 0x0C, "P03-11, denominator of the gear for command pulses. Without effect: the bus has its own gear."},
    {0x2003, 0x10,
     "P03-15, position deviation in tens of command units that raises AL.501, while 6065h is 0. 0 switches it off."},
    {0x2003, 0x11,
     "P03-16, time constant in 0.1 ms of a filter that smooths the position command, except in homing. The axis "
     "arrives later by this delay."},
    {0x2003, 0x45, "P03-68, longest time in seconds that homing may take before AL.551. 0 sets no limit."},
    {0x2004, any, "P04, speed: P04-nn is sub-index nn + 1, for the service port only. Acts at once."},
    {0x2004, 0x01,
     "P04-00, where speeds come from: 0 analogue, 1 P04-02, 2 communication, 3 internal segments. Without effect: the "
     "bus commands."},
    {0x2004, 0x02,
     "P04-01, sense of the analogue speed command: 0 normal, 1 inverted. Without effect: there is no analogue input."},
    {0x2004, 0x03, "P04-02, speed command in rpm for P04-00 = 1. Without effect: the bus commands."},
    {0x2004, 0x06,
     "P04-05, motor speed in rpm above which AL.420 is raised. 0 stands for 120 % of the motor's greatest speed."},
    {0x2004, 0x07, "P04-06, greatest forward speed in rpm; with 0 the axis does not move in that direction."},
    {0x2004, 0x08,
     "P04-07, greatest reverse speed in rpm, as 0 or a negative number; with 0 the axis does not move in that "
     "direction."},
    {0x2004, 0x0B,
     "P04-10, speed in 0.1 rpm below which the motor counts as standing, for a zero speed output. Kept without effect: "
     "there is no such output."},
    {0x2004, 0x0F,
     "P04-14, acceleration of speed control in milliseconds per 1000 rpm. Without effect: the bus has its own ramps."},
    {0x2004, 0x10,
     "P04-15, deceleration of speed control in milliseconds per 1000 rpm. Without effect: the bus has its own ramps."},
    {0x2005, any, "P05, torque: P05-nn is sub-index nn + 1, for the service port only. Acts at once."},
    {0x2005, 0x0B,
     "P05-10, greatest forward torque in 0.1 % of rated. The least of this, 6072h, 6073h and 60E0h counts."},
    {0x2005, 0x0C,
     "P05-11, greatest reverse torque in 0.1 % of rated, without sign. The least of this, 6072h, 6073h and 60E1h "
     "counts."},
    {0x2006, any,
     "P06, terminals: P06-nn is sub-index nn + 1, for the service port only. Acts from the next power-on."},
    {0x2006, 0x01,
     "P06-00, active level of the enable input. Kept without effect: these drives have no such input, the bus "
     "enables."},
    {0x2006, 0x15, "P06-20, level of the alarm output DO0: with 1 it conducts at an alarm, with 0 without one."},
    {0x2006, 0x17, "P06-22, level of the output DO1: with 1 it conducts in position, with 0 out of it."},
    {0x2008, any, "P08, filters: P08-nn is sub-index nn + 1, for the service port only. Acts at once."},
    {0x2008, 0x14,
     "P08-19, time constant in 0.01 ms of the filter on the measured speed. Raise it a little if the motor howls."},
    {0x2008, 0x15,
     "P08-20, time constant in 0.01 ms of the filter on the torque command, against noise. The level in P01-03 sets it "
     "while P01-02 is 1 or 2."},
    {0x2008, 0x1A,
     "P08-25, share in 0.1 % of the observed disturbing torque that is compensated. More resists loads better and "
     "makes "
     "more noise."},
    {0x2008, 0x1B,
     "P08-26, time constant in 0.01 ms of the filter on the observed disturbance. Longer is quieter, too long "
     "compensates too late."},
    {0x200D, any, "Monitoring items: item dnn is sub-index nn + 1, read at the service port only."},
    {0x200D, 0x01, "d00, commanded position in command units; comparing it with the master's shows what got lost."},
    {0x200D, 0x02, "d01, measured position in command units."},
    {0x200D, 0x03, "d02, how far the motor lags behind the command, in command units."},
    {0x200D, 0x04, "d03, commanded position in encoder counts."},
    {0x200D, 0x05, "d04, measured position in encoder counts."},
    {0x200D, 0x06, "d05, how far the motor lags behind the command, in encoder counts."},
    {0x200D, 0x07,
     "d06, how fast the position command moves, in thousands of command units per second; there is no pulse input."},
    {0x200D, 0x08, "d07, speed demand of the speed loop, in rpm."},
    {0x200D, 0x09, "d08, measured speed of the motor in rpm."},
    {0x200D, 0x0A, "d09, torque demand, in percent of rated."},
    {0x200D, 0x0B, "d10, torque that the motor gives, in percent of rated."},
    {0x200D, 0x0C, "d11, mean torque of the last 10 s in percent of rated, without sign."},
    {0x200D, 0x0D, "d12, greatest torque since power-on in percent of rated."},
    {0x200D, 0x0E,
     "d13, load of the motor over the last 10 s in percent of rated, as root mean square of the torque: lasting values "
     "above 100 overload it."},
    {0x200D, 0x0F, "d14, how busy the regeneration resistor was in the last 10 s, in percent."},
    {0x200D, 0x11,
     "d16, input terminals, bit 0 to 4 in the order CW-, HW+, CCW+, DI3, DI4: 1 means that the opto-coupler is off."},
    {0x200D, 0x12, "d17, outputs, bit 0 for DO0 (alarm), bit 1 for DO1 (in position): 1 means that it conducts."},
    {0x200D, 0x13, "d18, angle of the shaft within its turn, in 0.1 degrees."},
    {0x200D, 0x14,
     "d19, which of six sectors of the electrical turn the rotor is in, as levels U, V and W in bits 0 to 2."},
    {0x200D, 0x15, "d20, position of an absolute encoder within its turn; 0 here, the encoder is incremental."},
    {0x200D, 0x16, "d21, turns that an absolute encoder has counted; 0 here, the encoder is incremental."},
    {0x200D, 0x17,
     "d22, inertia of the load in percent of the motor's, as found in motion or by AF-J-L. Before that it is the value "
     "of P01-04."},
    {0x200D, 0x18, "d23, voltage of the main circuit in volts."},
    {0x200D, 0x19, "d24, temperature of the drive in degrees Celsius; above 95 it is an alarm."},
    {0x200D, 0x1A, "d25, seconds that the drive has been running altogether."},
    {0x200D, 0x1B, "d26, first resonance in Hz that the last search (200Eh sub-index 2) has found; 0 before."},
    {0x200D, 0x1D, "d28, second resonance in Hz that the last search (200Eh sub-index 2) has found; 0 before."},
    {0x200D, 0x1F, "d30, voltage at the first analogue input in 0.01 V; 0 here, there is none."},
    {0x200D, 0x20, "d31, voltage at the second analogue input in 0.01 V; 0 here, there is none."},
    {0x200E, any,
     "Functions of the PC software, started by writing 1 while the enabled axis stands. Read: 0 idle, 1 running, 2 "
     "done, 3 failed."},
    {0x200E, 0x01,
     "AF-J-L: 1 swings the axis about a turn to either side to find the inertia of the load. d22 shows it; write it to "
     "P01-04."},
    {0x200E, 0x02, "1 searches for mechanical resonances; d26 and d28 then show two of them."},
    {0x6040, any,
     "Commands of the master: 6, 7, Fh enable, 80h resets a fault. The motor has power and holds from 7 on; bit 8 "
     "halts "
     "in every mode; bits 4, 5, 6 and 9 belong to the mode."},
    {0x6041, any,
     "State of the drive: bits 0 to 6 the power state, 7 a warning, 8 halted (profile velocity), 10 reached, 11 beyond "
     "607Dh. 12 follows or home found, 13 following or homing error."},
    {0x605A, any,
     "Braking of a quick stop: 1 by 6084h, 2 by 6085h, from 3 on at once. It always ends in switch on disabled."},
    {0x605C, any,
     "Transition from operation enabled to switched on: 0 stop without a ramp, 1 slow down first. In switched on the "
     "motor holds its position under power."},
    {0x605D, any,
     "Braking of a halt (controlword bit 8), in the cyclic modes as well: 1 by 6084h (homing: 609Ah), 2 by 6085h, from "
     "3 on at once."},
    {0x6060, any,
     "Mode wanted: 1 profile position, 3 profile velocity, 4 profile torque, 6 homing, 8 cyclic position, 9 cyclic "
     "velocity, 10 cyclic torque. 0 changes nothing."},
    {0x6065, any,
     "Following error in command units beyond which the drive faults. FFFFFFFFh switches it off; 0 leaves it to "
     "P03-15."},
    {0x6072, any,
     "Greatest torque in 0.1 % of rated. The least of this, 6073h, 60E0h, 60E1h and P05-10, P05-11 counts; as "
     "delivered that is 6073h."},
    {0x6073, any,
     "Greatest current in 0.1 % of rated. It limits the torque along with 6072h, and as delivered (1200) before the "
     "others."},
    {0x6075, any,
     "Rated current of the motor in milliamperes. A value that the power stage cannot give continuously raises "
     "AL.060."},
    {0x607B, any,
     "Limits how far one 607Ah may be from the next in cyclic position, with a warning; acts only after it was "
     "written. "
     "No range of a round axis."},
    {0x607B, 0x01, "Furthest step of 607Ah in negative direction, in command units."},
    {0x607B, 0x02, "Furthest step of 607Ah in positive direction, in command units."},
    {0x607C, any,
     "Way in command units that the axis really travels, at 6099h sub-index 2, after home was found; there its "
     "position "
     "becomes 0. Not in method 35."},
    {0x607D, any,
     "Software limits in command units; a target beyond them stops the axis with a fault. The minimum must be below "
     "the "
     "maximum, else AL.100."},
    {0x607E, any,
     "Turns directions round: bit 7 positions, bit 6 velocities. With bit 7 the limit switches change places in 60FDh. "
     "Not while the motor has power."},
    {0x607F, any,
     "Greatest speed of the profile modes in command units/s. Only 216 rpm as delivered: raise it for faster moves. "
     "The lower of this and 6080h counts."},
    {0x6080, any,
     "Greatest speed of the motor in rpm. A faster command is AL.420 in profile position and cyclic velocity; cyclic "
     "position and profile velocity run at it with a warning."},
    {0x6081, any,
     "Speed of a move in profile position, in command units/s. Above the lower of 607Fh and 6080h the move is not "
     "begun "
     "and AL.420 raised."},
    {0x6082, any,
     "Speed with which a move from rest begins at once, in command units/s, as steppers do. Not the speed at its end, "
     "which is 0."},
    {0x6083, any,
     "Acceleration of the profile modes in command units/s2. Above 60C5h it is clipped, with a warning; 0 means "
     "60C5h."},
    {0x6084, any,
     "Deceleration of the profile modes and of a halt in command units/s2. Above 60C6h it is clipped, with a warning; "
     "0 "
     "means 60C6h."},
    {0x6085, any, "Deceleration of a quick stop in command units/s2; 0 means 60C6h."},
    {0x608F, any,
     "Encoder increments (sub-index 1) per motor revolutions (sub-index 2), the first factor of the electronic gear. "
     "To be set in Pre-Operational with the motor off."},
    {0x6091, any,
     "Gear: motor revolutions (sub-index 1) per shaft revolutions (sub-index 2). With 608Fh and 6092h it must make "
     "1/1000 "
     "to 1000, else AL.105. To be set in Pre-Operational."},
    {0x6092, any,
     "Feed: command units (sub-index 1) per shaft revolutions (sub-index 2). The simplest way to the unit wanted: "
     "units "
     "per motor revolution here. To be set in Pre-Operational."},
    {0x6098, any,
     "Homing method, 1 to 14 with index, 17 to 30 without, 33 and 34 index alone, 35 right here; 0, 15, 16, 31 and 32 "
     "do nothing. CW is positive."},
    {0x6099, 0x01,
     "Fast speed, at which homing looks for the switch, in command units/s. 0, as delivered, refuses the start with "
     "statusword bit 13."},
    {0x6099, 0x02,
     "Slow speed, for the edge or index that decides and for the way of 607Ch afterwards, in command units/s."},
    {0x609A, any, "Acceleration and deceleration of homing in command units/s2, at a limit switch too; 0 means 60C5h."},
    {0x60B2, any,
     "Torque in 0.1 % of rated added in the cyclic modes: feed forward from the master. 32 bits wide, clipped to 16."},
    {0x60B8, any,
     "Touch probes, low byte for DI3, high byte for DI4: bit 0 on, 1 continuous, 2 index instead of the input, 3 no "
     "source, 4 rising and 5 falling edge."},
    {0x60C2, any,
     "Time between targets in cyclic modes, used while there is no SYNC0: sub-index 1 times ten to the power of "
     "sub-index 2 seconds, 1 ms as delivered."},
    {0x60C5, any,
     "Greatest acceleration in command units/s2: limits 6083h, and replaces 6083h and 609Ah if they are 0."},
    {0x60C6, any,
     "Greatest deceleration in command units/s2: limits 6084h, and replaces 6084h and 6085h if they are 0."},
    {0x60FD, any,
     "Inputs, 1 for active: bit 0 CCW limit, 1 CW limit, 2 home switch, 9 touch probe 1, 10 touch probe 2."},
    {0x60FE, 0x01, "Bit 0: 1 closes the brake, 0 opens it, where bit 0 of sub-index 2 is set."},
    {0x60FE, 0x02, "Bit 0: 1 gives the brake to the master, 0 leaves it to the drive."},
    {0x60FF, any,
     "Target velocity in command units/s. Above the greatest speed cyclic velocity stops with AL.420, while profile "
     "velocity runs at it with a warning."},
});

}  // namespace servodrome::catalogue::jmc_ec
