#pragma once

// Kinco iSMK: the maker's own objects, from the chapters of its manual on inputs and outputs, loops, storage and
// alarms, and standard objects that it uses in another way. "DEC" is the manual's name for the drive's own units
// (chapter 7).
#include <array>

#include "catalogue/object_texts.hpp"

namespace servodrome::catalogue::ismk {

inline constexpr std::uint8_t any = any_sub;

inline constexpr auto object_texts = std::to_array<ObjectText>({
    {0x1001, any, "One bit for each class of error that is present, as CiA 301 has them, and bit 6 for the encoder."},
    {0x100B, any,
     "Station number, 1 to 127: the node-ID on CAN and the address at the RS485 port. It acts after storing and a "
     "restart."},
    {0x1800, 0x03, "Least time between two of these PDOs, in milliseconds, not in steps of 100 microseconds."},
    {0x1801, 0x03, "Least time between two of these PDOs, in milliseconds, not in steps of 100 microseconds."},
    {0x1802, 0x03, "Least time between two of these PDOs, in milliseconds, not in steps of 100 microseconds."},
    {0x1803, 0x03, "Least time between two of these PDOs, in milliseconds, not in steps of 100 microseconds."},
    {0x2010, any, "The terminals: what each input and output is for, their sense, and levels that are simulated."},
    {0x2010, 0x01, "Polarity of the inputs, bit n for input n + 1: 1 is normally open, 0 normally closed."},
    {0x2010, 0x02,
     "Simulated inputs, one bit each: they count as active independent of their wire, for commissioning without "
     "wiring."},
    {0x2010, 0x03,
     "Function of input 1: 0 nothing, 1h enable, 2h reset, 4h mode, 8h Kvi off, 10h and 20h limits, 40h home, 80h "
     "direction, 1000h quick stop, 2000h start of homing, 4000h start of a move; input 2 has more."},
    {0x2010, 0x04,
     "Function of input 2, by the codes of input 1; also 100h, 200h, 8001h speed index, 400h, 800h, 8002h position "
     "index, 8020h, 8040h gain set, 8100h motor error, 8200h pre-enable, 8400h, 8800h capture."},
    {0x2010, 0x05,
     "Function of input 3, by the codes of inputs 1 and 2. The iSMK has no terminal for it: it is switched by "
     "simulation (sub-index 2)."},
    {0x2010, 0x06,
     "Function of input 4, by the codes of inputs 1 and 2. The iSMK has no terminal for it: it is switched by "
     "simulation (sub-index 2)."},
    {0x2010, 0x07,
     "Function of input 5, by the codes of inputs 1 and 2. The iSMK has no terminal for it: it is switched by "
     "simulation (sub-index 2)."},
    {0x2010, 0x0A, "Levels of the inputs at the terminals, one bit each."},
    {0x2010, 0x0D, "Polarity of the outputs, bit n for output n + 1: 1 normal, 0 inverted."},
    {0x2010, 0x0E,
     "Simulated outputs: they are on independent of their function, bit n for output n + 1; bit 4: brake."},
    {0x2010, 0x0F,
     "Signal at output 1: 1h ready, 2h error, 4h position reached, 8h standstill, 10h brake open, 20h speed reached, "
     "100h enabled, 200h limit, 400h home found, 800h torque reached."},
    {0x2010, 0x10,
     "Signal at output 2, by the codes of output 1; also 40h index, 80h speed limit, 1000h, 2000h and 4000h the index "
     "of the position reached."},
    {0x2010, 0x14, "Levels of the outputs at the terminals, one bit each."},
    {0x2010, 0x18,
     "Speed up to which the axis counts as standing, in increments per millisecond, once it lasted as long as 60F9h "
     "sub-index 14h."},
    {0x2010, 0x19,
     "Effect of a limit switch after homing: 0 raises an alarm (2602h bits 9 and 10), 1 stops the axis only."},
    {0x2010, 0x1B, "Actual position when the positive limit switch was met last, in increments."},
    {0x2010, 0x1C, "Actual position when the negative limit switch was met last, in increments."},
    {0x2020, any, "Positions, speeds, modes and controlword that inputs can choose, for a drive without a master."},
    {0x2020, 0x01, "Target position in increments while the inputs' position index is 0."},
    {0x2020, 0x02, "Target position in increments while the inputs' position index is 1."},
    {0x2020, 0x03, "Target position in increments while the inputs' position index is 2."},
    {0x2020, 0x04, "Target position in increments while the inputs' position index is 3."},
    {0x2020, 0x05, "Target speed of modes 3 and -3 while the speed index is 0, and speed to position 0; in DEC."},
    {0x2020, 0x06, "Target speed of modes 3 and -3 while the speed index is 1, and speed to position 1; in DEC."},
    {0x2020, 0x07, "Target speed of modes 3 and -3 while the speed index is 2, and speed to position 2; in DEC."},
    {0x2020, 0x08, "Target speed of modes 3 and -3 while the speed index is 3, and speed to position 3; in DEC."},
    {0x2020, 0x0D, "Mode of operation while the input for the mode is off; see 6060h."},
    {0x2020, 0x0E, "Mode of operation while the input for the mode is on; see 6060h."},
    {0x2020, 0x0F,
     "Controlword that the input Enable writes when it goes on; off writes 06h. 2Fh is for absolute moves, 4Fh for "
     "relative ones."},
    {0x2020, 0x10, "Target position in increments while the inputs' position index is 4."},
    {0x2020, 0x11, "Target position in increments while the inputs' position index is 5."},
    {0x2020, 0x12, "Target position in increments while the inputs' position index is 6."},
    {0x2020, 0x13, "Target position in increments while the inputs' position index is 7."},
    {0x2020, 0x14, "Target speed of modes 3 and -3 while the speed index is 4, and speed to position 4; in DEC."},
    {0x2020, 0x15, "Target speed of modes 3 and -3 while the speed index is 5, and speed to position 5; in DEC."},
    {0x2020, 0x16, "Target speed of modes 3 and -3 while the speed index is 6, and speed to position 6; in DEC."},
    {0x2020, 0x17, "Target speed of modes 3 and -3 while the speed index is 7, and speed to position 7; in DEC."},
    {0x2340, any, "Further gain sets of the loops, and automatic tuning."},
    {0x2340, 0x01,
     "1: at the target of mode 1 a direct current holds the shaft, in place of the loops, until the next move. 0: the "
     "loops hold it."},
    {0x2340, 0x02, "Current that holds the shaft where sub-index 1 is 1; 2048 is the drive's peak current."},
    {0x2340, 0x04, "Proportional gain of the velocity loop in gain set 1, as 60F9h sub-index 1."},
    {0x2340, 0x05, "Integral gain of the velocity loop in gain set 1, as 60F9h sub-index 2."},
    {0x2340, 0x06, "Gain of the position loop in gain set 1, in 0.01 Hz."},
    {0x2340, 0x07, "Proportional gain of the velocity loop in gain set 2, as 60F9h sub-index 1."},
    {0x2340, 0x08, "Integral gain of the velocity loop in gain set 2, as 60F9h sub-index 2."},
    {0x2340, 0x09, "Gain of the position loop in gain set 2, in 0.01 Hz."},
    {0x2340, 0x0A, "Proportional gain of the velocity loop in gain set 3, as 60F9h sub-index 1."},
    {0x2340, 0x0B, "Integral gain of the velocity loop in gain set 3, as 60F9h sub-index 2."},
    {0x2340, 0x0C, "Gain of the position loop in gain set 3, in 0.01 Hz."},
    {0x2340, 0x10,
     "Automatic tuning: bit 0 on, 1 adapts the velocity gain, 2 the acceleration feed forward, 4 and 5 keep it from "
     "one direction, 7 uses the friction."},
    {0x2502, any, "Analogue inputs, of which only one object is documented; the iSMK has no terminals for them."},
    {0x2502, 0x07, "Speed by an analogue input; it must be 0 for the inputs to choose speeds of 2020h."},
    {0x2508, any, "Pulse input, and the time window of the position."},
    {0x2508, 0x08,
     "To be raised for pulse frequencies above 600 kHz (alarm 2601h bit 12). The iSMK has no terminals for pulses: it "
     "is "
     "stored only."},
    {0x2508, 0x09,
     "Time in milliseconds for which the axis must be within 6067h until the target counts as reached; the same value "
     "as 6068h."},
    {0x250A, any, "Main encoder of a full closed loop, and the checks of it. They are stored only."},
    {0x250A, 0x01,
     "Period of the main encoder, by which its index is checked (alarm 2602h bit 15); 0 switches the check off."},
    {0x250A, 0x03,
     "Direction in which the main encoder counts; to be changed where it is opposite to the motor's (alarm 2602h bit "
     "13)."},
    {0x250A, 0x05,
     "Check of the spindle in full closed loop; check it after alarm 2602h bit 13. Its values are not documented."},
    {0x250A, 0x06,
     "Check of the slave shaft in full closed loop; check it after alarm 2602h bit 13. Its values are not documented."},
    {0x250A, 0x09,
     "Check of the ratio in full closed loop; check it after alarm 2602h bit 13. Its values are not documented."},
    {0x250B, any, "Frequencies of the notch filters in the torque command."},
    {0x250B, 0x01,
     "Frequency of notch filter 1 in Hz; the analysis of 60F9h sub-index 4 may write it. On with the codes 2 and 3 "
     "there."},
    {0x250B, 0x02, "Frequency of notch filter 2 in Hz, set by hand. On with code 3 of 60F9h sub-index 4."},
    {0x250B, 0x03, "Frequency of notch filter 3 in Hz, set by hand. On with code 3 of 60F9h sub-index 4."},
    {0x2601, any, "Active alarms, one bit each; `faults` of the axis explains them."},
    {0x2602, any, "Active alarms of the second word, one bit each; `faults` of the axis explains them."},
    {0x2605, any,
     "Masks of the monitored alarms, and of the alarms that the drive's own history keeps with the motor on and off."},
    {0x2605, 0x01, "Monitored alarms of 2601h; an alarm whose bit is 0 is ignored."},
    {0x2605, 0x02, "Alarms of 2601h that the history keeps when they come with the motor enabled."},
    {0x2605, 0x03, "Alarms of 2601h that the history keeps when they come with the motor off; none from the factory."},
    {0x2605, 0x04, "Monitored alarms of 2602h; an alarm whose bit is 0 is ignored."},
    {0x2605, 0x05, "Alarms of 2602h that the history keeps when they come with the motor enabled."},
    {0x2605, 0x06, "Alarms of 2602h that the history keeps when they come with the motor off."},
    {0x2605, 0x07,
     "Details of active alarms: bit 0 home record, 1 and 2 brake resistor hot and shorted, 3 motor phase, 4 current "
     "sampling, 12 bus time-out."},
    {0x2690, any,
     "10 makes invalid turns of a multi-turn encoder (2601h bit 2) good again; reset the fault or restart after it."},
    {0x2F81, any,
     "Bit rate of CAN as a code: 100 is 1 Mbit/s, 50 is 500, 25 is 250, 12 is 125, 5 is 50 and 1 is 10 kbit/s. It acts "
     "after storing and a restart."},
    {0x2FE2, any,
     "Bit rate of the RS485 port as a code: 1080 is 9600, 540 is 19200, 270 is 38400, 90 is 115200 bit/s. It acts "
     "after "
     "storing and a restart."},
    {0x2FF0, any, "Storage, and parameters in units for people."},
    {0x2FF0, 0x01, "1 stores the control parameters, 10 brings their factory values back; not those of the motor."},
    {0x2FF0, 0x03, "1 stores the motor's parameters."},
    {0x2FF0, 0x09, "Target speed in rpm; the same target as 60FFh."},
    {0x2FF0, 0x0A,
     "Bandwidth of the velocity loop in Hz; a write computes the velocity gain again, from the inertia ratio."},
    {0x2FF0, 0x0E, "Greatest following error in steps of 100 increments; the same limit as 6065h."},
    {0x2FF0, 0x10, "Load of the motor by I2t, in percent; at 100 comes alarm 2601h bit 11."},
    {0x2FF0, 0x11, "Load of the drive by I2t, in percent; at 100 comes alarm 2601h bit 11."},
    {0x2FF0, 0x19,
     "Integral gain of the velocity loop in one: 32 times 60F9h sub-index 2 and sub-index 7. Writing it sets these to "
     "0 "
     "and to the value."},
    {0x2FF0, 0x1A, "Velocity feed forward of the position loop in permille: 1000 is full, 0 is off."},
    {0x2FF0, 0x1B,
     "Acceleration feed forward of the position loop in permille: 1000 is full, 0 is off. It is right only where the "
     "inertia is known."},
    {0x2FF1, any, "Writes the positions of 2020h from two halves of 16 bits, for masters without 32-bit values."},
    {0x2FF1, 0x01, "Number of the position, 0 to 7, that sub-indices 2 and 3 write."},
    {0x2FF1, 0x02, "Upper part M of the position: M * 10000 + N increments."},
    {0x2FF1, 0x03, "Lower part N of the position: M * 10000 + N increments."},
    {0x2FFF, any, "AA55h restarts the drive, and home is lost. 55AAh would start the boot loader and is refused here."},
    {0x3011, any, "Synchronisation of mode 7 with the SYNC of the bus."},
    {0x3011, 0x01, "Period of the master's targets in mode 7: 0 is 1, 1 is 2, 2 is 4 and 3 is 8 milliseconds."},
    {0x3011, 0x02, "1: in mode 7 each SYNC takes the target 607Ah over; 0: writing it does."},
    {0x3011, 0x04,
     "Counts the SYNCs that did not come in time in mode 7. A rising number points to a wrong period or to "
     "interference."},
    {0x3041, any, "Source of the motor's data."},
    {0x3041, 0x06,
     "Source of the motor's data: 0 the model that the encoder reports, 1 the model that the user enters, 2 the memory "
     "of the encoder. It is stored only."},
    {0x6007, any, "Reaction to the loss of the master: 0 none, 1 alarm 2602h bit 12, and the axis brakes by 605Eh."},
    {0x6040, any,
     "Commands of the master, as CiA 402 has them. With bit 12 of mode 1 (103Fh) the target follows 607Ah without a "
     "further edge; bit 8 does nothing in mode 4."},
    {0x6041, any,
     "State of the drive: bit 9 is 1 unless an input enables the motor, 12 in homing is an error, 14 is 1 once the "
     "commutation is found, 15 once home is found."},
    {0x605A, any,
     "Braking of a quick stop: 0 power off, 1 by 6084h and 2 by 6085h, then off; 5 by 6084h and 6 by 6085h, then held; "
     "18 by shorting the windings, then held."},
    {0x605B, any,
     "Braking in the transition from operation enabled to ready to switch on: 0 power off, 1 by 6084h, 2 by 6085h, 18 "
     "by shorting the windings."},
    {0x605C, any,
     "Braking in the transition from operation enabled to switched on: 0 power off, 1 by 6084h, 2 by 6085h, 18 by "
     "shorting the windings."},
    {0x605D, any,
     "Braking of a halt (controlword bit 8): 1 by 6084h, 2 by 6085h. The drive stays enabled; mode 4 has no halt."},
    {0x605E, any, "Braking after an alarm: 0 power off, 1 by 6084h, 2 by 6085h, 18 by shorting the windings."},
    {0x6060, any,
     "Mode wanted: 1 position, 3 speed with ramps, 4 torque, 6 homing, 7 interpolation, -3 speed without ramps, -4 "
     "pulses. Always -4 after power-on, where the axis stands still."},
    {0x6063, any,
     "Actual position in increments, after homing and 607Eh. After power-on it is within one revolution: the encoder "
     "counts no turns."},
    {0x6065, any,
     "Distance in increments between demand and actual position beyond which comes alarm 2601h bit 9; 2FF0h sub-index "
     "0Eh is the same in hundreds."},
    {0x606C, any, "Actual velocity in DEC: 1 rpm is 17895.7 with 65536 increments per revolution."},
    {0x6071, any,
     "Target torque of mode 4 in 0.1 % of the rated torque. 60F6h sub-index 8 is the same target as a current; the one "
     "written last counts."},
    {0x6073, any, "Greatest current, where 2048 is the drive's peak current."},
    {0x6078, any, "Actual current that makes torque, where 2048 is the drive's peak current."},
    {0x607C, any,
     "Distance between home and zero of the position, in increments; 6099h sub-index 5 says whether the axis runs "
     "there."},
    {0x607D, any,
     "Software limits in increments, the positive one first. They act after homing, and only where the negative one is "
     "less than the positive."},
    {0x607D, 0x01, "Greatest position that the axis goes to, in increments: the other way round than in CiA 402."},
    {0x607D, 0x02, "Smallest position that the axis goes to, in increments: the other way round than in CiA 402."},
    {0x607E, any,
     "Positive direction of the shaft: 0 counter-clockwise, 1 clockwise. To be changed only while the motor is off."},
    {0x607F, any,
     "Greatest speed of modes 3, -3 and 4 in DEC, 17895.7 to the rpm with 65536 increments per revolution; 6080h is "
     "the "
     "same limit in rpm."},
    {0x6080, any, "Greatest speed in rpm; the same limit as 607Fh."},
    {0x6081, any,
     "Speed of a move in mode 1 in DEC, 17895.7 to the rpm with 65536 increments per revolution. With 0, the "
     "factory's, "
     "nothing moves."},
    {0x6083, any,
     "Acceleration of modes 1 and 3 in DEC: 1 revolution per second squared is 1073.74 with 65536 increments per "
     "revolution."},
    {0x6084, any,
     "Deceleration of modes 1 and 3 in DEC, 1073.74 to the revolution per second squared with 65536 increments per "
     "revolution; also where a stop code is 1."},
    {0x6085, any,
     "Deceleration of a quick stop and at a limit switch in DEC, 1073.74 to the revolution per second squared with "
     "65536 increments per revolution."},
    {0x6098, any,
     "Homing method; 0, the factory's, is none and an error when started. A switch that the method looks for must be "
     "the function of an input."},
    {0x6099, 0x01, "Fast speed, of the search for the switch, in DEC as 6081h."},
    {0x6099, 0x02, "Slow speed, of the search for the edge or index that determines home, in DEC as 6081h."},
    {0x6099, 0x03, "1: the drive homes by itself when it is enabled first after power-on."},
    {0x6099, 0x04, "Greatest current while homing."},
    {0x6099, 0x05,
     "End of homing: 0 the axis moves on by the offset and shows 0 there, 1 it stays at home and shows the offset."},
    {0x6099, 0x06,
     "Index pulses so close behind the edge of a switch are passed by: 0 none, 1 chosen by the drive, 2 half a "
     "revolution."},
    {0x609A, any, "Acceleration and deceleration during homing, in DEC as 6083h."},
    {0x60F5, any,
     "Condition under which the torque counts as reached, for the output with that function, in every mode."},
    {0x60F5, 0x06,
     "Current from which on the torque counts as reached, where 2048 is the drive's peak current. 0 switches it off."},
    {0x60F5, 0x07, "Time in milliseconds for which the current must be at least that of sub-index 6."},
    {0x60F5, 0x08, "Actual current that is compared with sub-index 6, where 2048 is the drive's peak current."},
    {0x60F6, any, "Target of the current loop."},
    {0x60F6, 0x08,
     "Target current of mode 4, where 2048 is the drive's peak current. 6071h is the same target as a torque; the one "
     "written last counts."},
    {0x60F9, any, "The velocity loop: gains, filters, choice of the gain set, and what counts as reached or standing."},
    {0x60F9, 0x01,
     "Proportional gain of the velocity loop in gain set 0; more makes the loop faster, too much makes it ring."},
    {0x60F9, 0x02, "Integral gain of the velocity loop in gain set 0; sub-index 7 is its finer part."},
    {0x60F9, 0x03,
     "Frequency of notch filter 0 in Hz; the analysis of sub-index 4 writes it. On with the codes 1 to 3 there."},
    {0x60F9, 0x04,
     "Notch filters: bits 0 and 1 switch on 0 none, 1 filter 0, 2 filters 0 and 1, 3 all. Bit 7 looks for resonances "
     "while the motor is enabled, with bit 5 in the speed."},
    {0x60F9, 0x05, "Bandwidth of the filter in the velocity feedback: 100 Hz and 20 Hz for each step."},
    {0x60F9, 0x06,
     "Velocity feedback: 0 second-order filter, 1 unfiltered, 2 observer, 4 first-order filter; 10, 11, 12, 14 the "
     "same "
     "with filtered command. Bit 7: loops at 8 and 2 kHz."},
    {0x60F9, 0x07, "Finer part of the integral gain in gain set 0: 32 of it make 1 of sub-index 2."},
    {0x60F9, 0x08, "Greatest output of the velocity loop's integral; 0 is no limit."},
    {0x60F9, 0x09,
     "1: gain set 1 at the target or at standstill, set 0 in motion, unless inputs choose the set. 0: as sub-index 28h "
     "says."},
    {0x60F9, 0x0A,
     "In the speed modes the target counts as reached within this difference, in DEC; 178956, the factory's, is 10 "
     "rpm."},
    {0x60F9, 0x14,
     "Time in milliseconds for which the speed must be within 2010h sub-index 18h until the axis counts as at rest."},
    {0x60F9, 0x15, "Low-pass filter at the output of the velocity loop: 2546 Hz divided by it; 1 is off."},
    {0x60F9, 0x1A, "Actual velocity in increments per millisecond."},
    {0x60F9, 0x1C, "Target speed minus actual speed, in DEC."},
    {0x60F9, 0x28, "Gain set in use, 0 to 3: chosen by inputs, else by sub-index 9, else written here."},
    {0x60FB, any, "The position loop: gain, feed forward, shape and smoothing of the demand."},
    {0x60FB, 0x01, "Gain of the position loop in gain set 0, in 0.01 Hz; at most a quarter of the velocity loop's."},
    {0x60FB, 0x02,
     "Velocity feed forward of the position loop, which keeps the following error small; the value of 2FF0h sub-index "
     "1Ah."},
    {0x60FB, 0x03,
     "Acceleration feed forward of the position loop: the smaller the stronger, and 32767, the factory's, is off. "
     "2FF0h "
     "sub-index 1Bh has it in permille."},
    {0x60FB, 0x04, "Shape of the ramps of mode 1: 1 trapezoid, 3 S-curve. Mode 3 always has linear ramps."},
    {0x60FB, 0x05,
     "Smoothing of the demand: a mean over so many milliseconds, which delays it as well. To be changed only while the "
     "motor is off."},
    {0x60FD, any,
     "Inputs by what they are for: bit 0 negative limit, 1 positive limit, 2 home, 4 interlock (pre-enable missing), "
     "where CiA 402 has bit 3."},
    {0x60FF, any,
     "Target speed of modes 3 and -3 in DEC, 17895.7 to the rpm with 65536 increments per revolution; 2FF0h sub-index "
     "9 "
     "is the same in rpm."},
    {0x6410, any, "The motor: encoder, brake and temperature. Stored by 2FF0h sub-index 3, not by 1."},
    {0x6410, 0x03, "Increments of the encoder per revolution of the motor."},
    {0x6410, 0x0B,
     "Greatest current of the motor, where 2048 is the drive's peak current; 6073h has it from the factory."},
    {0x6410, 0x11, "Voltage of the brake's coil in percent of 24 V, by pulse width; 40 to 90 are recommended."},
    {0x6410, 0x12,
     "Time in milliseconds that the brake takes: motion begins this time after enabling, and power goes off this time "
     "after the brake closes."},
    {0x6410, 0x17, "Whether the motor has a holding brake: 0 no, 1 yes."},
    {0x6410, 0x18, "Temperature of the motor in degrees Celsius above which comes alarm 2601h bit 13."},
    {0x6410, 0x19, "Temperature of the motor in degrees Celsius; -40 without a sensor or with a faulty one."},
    {0x6410, 0x1F,
     "Resolution of a simulated incremental encoder, in increments per revolution: 4000, 8000, 10000; 0 is off. It is "
     "stored only."},
    {0x6510, any, "The drive: its peak current, supply limits, and the protocol of the RS485 port."},
    {0x6510, 0x03, "Peak current of the drive in ampere peak: what 2048 stands for in all currents in DEC."},
    {0x6510, 0x07, "Supply voltage in volts below which comes alarm 2601h bit 6."},
    {0x6510, 0x08, "Supply voltage in volts at which a brake resistor would be switched on; the iSMK has none inside."},
    {0x6510, 0x09, "Supply voltage in volts above which comes alarm 2601h bit 5."},
    {0x6510, 0x0B, "Drives at the serial port: 0 one, 1 several in a cascade. It is stored only."},
    {0x6510, 0x0C,
     "Protocol of the RS485 port: bit 0 is 0 for Modbus, 1 for the manufacturer-specific frames of 10 bytes; bit 1 "
     "makes it act only "
     "after storing and a restart."},
    {0x6510, 0x0E, "Format at the RS485 port, which is fixed: 8 data bits, 1 stop bit, no parity."},
});

}  // namespace servodrome::catalogue::ismk
