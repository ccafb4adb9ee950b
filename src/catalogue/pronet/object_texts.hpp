#pragma once

// ESTUN ProNet: the maker's own objects, and those that it uses in another way than the standards. The CANopen manual
// does not explain most parameters Pn and monitors Un: their texts say so.
#include <array>

#include "catalogue/object_texts.hpp"

namespace servodrome::catalogue::pronet {

inline constexpr std::uint8_t any = any_sub;

inline constexpr auto object_texts = std::to_array<ObjectText>({
    {0x0002, any,
     "Filler for the mapping of a received PDO, 8-bit signed: these bits are for another drive, and this drive ignores "
     "them."},
    {0x0003, any,
     "Filler for the mapping of a received PDO, 16-bit signed: these bits are for another drive, and this drive "
     "ignores them."},
    {0x0004, any,
     "Filler for the mapping of a received PDO, 32-bit signed: these bits are for another drive, and this drive "
     "ignores them."},
    {0x0005, any,
     "Filler for the mapping of a received PDO, 8-bit unsigned: these bits are for another drive, and this drive "
     "ignores them."},
    {0x0006, any,
     "Filler for the mapping of a received PDO, 16-bit unsigned: these bits are for another drive, and this drive "
     "ignores them."},
    {0x0007, any,
     "Filler for the mapping of a received PDO, 32-bit unsigned: these bits are for another drive, and this drive "
     "ignores them."},
    {0x1005, any,
     "Identifier of the SYNC message, fixed at 80h. The drive only consumes SYNC; no write makes it produce one."},
    {0x1006, any,
     "Time between two SYNC messages of the master in microseconds. Set for interpolated position, together with 2105h "
     "and 60C2h."},
    {0x1016, any,
     "The heartbeat that the drive waits for: node-ID in bits 16 to 23, time in milliseconds in bits 0 to 15. A "
     "missing heartbeat is alarm 8130h; 1029h selects the reaction of the NMT state."},
    {0x1400, 0x02, "1 to 240: taken over at the next SYNC. 255: at once. Other values are refused."},
    {0x1600, any,
     "Objects of a received PDO, at most 4 and 64 bits: index in bits 16 to 31, sub-index in 8 to 15, length in 0 to "
     "7. To change: sub-index 0 to 0, write entries, then their number. The PDO may stay on."},
    {0x1800, 0x01, "Identifier of the PDO; bit 31 switches it off. Remote frames are never answered."},
    {0x1800, 0x02,
     "n from 1 to 240: with every nth SYNC. 254: when the content changes, as far as 2000h to 2003h let it show. 255: "
     "only by "
     "the event timer. Other values are refused."},
    {0x1800, 0x05,
     "Event timer in milliseconds: with types 254 and 255 the PDO is sent when it ends, 10 from the factory. 0: no "
     "timer, and nothing is sent with type 255."},
    {0x1A00, any,
     "Objects of a sent PDO, at most 4 and 64 bits: index in bits 16 to 31, sub-index in 8 to 15, length in 0 to 7. "
     "Changed like the mapping of received PDOs."},
    {0x2000, any,
     "Mask of TPDO 1 with transmission type 254: a change of a bit that is 1 here sends the PDO. From the factory all "
     "bits are 1."},
    {0x2000, 0x01,
     "Mask of the first four bytes of TPDO 1, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2000, 0x02,
     "Mask of the last four bytes of TPDO 1, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2001, any,
     "Mask of TPDO 2 with transmission type 254: a change of a bit that is 1 here sends the PDO. From the factory all "
     "bits are 1."},
    {0x2001, 0x01,
     "Mask of the first four bytes of TPDO 2, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2001, 0x02,
     "Mask of the last four bytes of TPDO 2, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2002, any,
     "Mask of TPDO 3 with transmission type 254: a change of a bit that is 1 here sends the PDO. From the factory all "
     "bits are 1."},
    {0x2002, 0x01,
     "Mask of the first four bytes of TPDO 3, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2002, 0x02,
     "Mask of the last four bytes of TPDO 3, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2003, any,
     "Mask of TPDO 4 with transmission type 254: a change of a bit that is 1 here sends the PDO. From the factory all "
     "bits are 1."},
    {0x2003, 0x01,
     "Mask of the first four bytes of TPDO 4, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2003, 0x02,
     "Mask of the last four bytes of TPDO 4, lowest byte first: a change of a bit that is 0 here does not send the "
     "PDO."},
    {0x2105, any,
     "Period of set-points in interpolated position, in microseconds; set it to the same time as 60C2h. Two periods "
     "without a new set-point are alarm A 69. 0: the period of 60C2h."},
    {0x2F10, any,
     "Pn201, numerator of the electronic gear: copied to 6093h:01 at power-on. The real drive has no object for it."},
    {0x2F11, any,
     "Pn202, divisor of the electronic gear: copied to 6093h:02 at power-on; 0 is alarm 5582h then. The real drive has "
     "no object for it."},
    {0x2F12, any,
     "Counts of the encoder in a revolution of the motor, as it is fitted. The real drive has no object for it."},
    {0x3000, any, "Pn000; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3001, any, "Pn001; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3002, any, "Pn002; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3003, any, "Pn003; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3004, any, "Pn004; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3005, any, "Pn005; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3006, any,
     "Hex digits from the lowest: bus (0 none, 1, 2 PROFIBUS, 3 CANopen), none, low-frequency vibration suppression, "
     "pulse filter (0 4 MHz, 1 650 kHz, 2 150 kHz). Only the bus acts here, after a restart."},
    {0x3007, any, "Pn007; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3010, any, "Pn100; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3011, any, "Pn101; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3012, any, "Pn102, in Hz; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3013, any, "Pn103, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3014, any, "Pn104, in 1/s; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3015, any, "Pn105, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3016, any, "Pn106; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3017, any, "Pn107, in Hz; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3018, any, "Pn108, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3019, any, "Pn109, in Hz; the CANopen manual does not say what for. Kept, without effect here."},
    {0x301A, any, "Pn110, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x301B, any, "Pn111, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x301C, any, "Pn112, in %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x301D, any, "Pn113, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x301E, any, "Pn114, in %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x301F, any, "Pn115, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3020, any, "Pn116; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3021, any, "Pn117, in %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3022, any,
     "Pn118, the target of the manual's example of a parameter write, which gives neither purpose nor unit. Kept, "
     "without effect here."},
    {0x3023, any, "Pn119; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3024, any, "Pn120; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3025, any, "Pn121; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3026, any, "Pn122, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3027, any, "Pn123; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3028, any, "Pn124; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3029, any, "Pn125, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x302A, any, "Pn126; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x302B, any, "Pn127, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x302C, any, "Pn128, in steps of 0.1 %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x302D, any, "Pn129, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x302E, any, "Pn130, in steps of 0.1 %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x302F, any, "Pn131, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3030, any,
     "Pn132, in steps of 0.1 % for every 1000 rpm; the CANopen manual does not say what for. Kept, without effect "
     "here."},
    {0x3055, any, "Pn305, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3056, any, "Pn306, in ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3057, any, "Pn307, in ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3058, any, "Pn308, in ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3059, any, "Pn309, in ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x305A, any, "Pn310; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x305B, any, "Pn311; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3068, any,
     "Pn401: here the greatest torque forward, in % of the rated torque, with statusword bit 11 to show it; 300 from "
     "the factory. The manual gives only the unit."},
    {0x3069, any,
     "Pn402: here the greatest torque in reverse, in % of the rated torque, with statusword bit 11 to show it; 300 "
     "from the factory. The manual gives only the unit."},
    {0x306A, any, "Pn403, in %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x306B, any, "Pn404, in %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x306C, any, "Pn405, in %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x306D, any, "Pn406, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x306E, any, "Pn407, in Hz; the CANopen manual does not say what for. Kept, without effect here."},
    {0x306F, any, "Pn408; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3070, any, "Pn409, in Hz; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3071, any, "Pn410; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3072, any, "Pn411, in steps of 0.1 Hz; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3073, any, "Pn412; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3074, any, "Pn413, in steps of 0.1 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3075, any, "Pn414, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3078, any, "Pn500, in pulses; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3079, any, "Pn501, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x307A, any, "Pn502, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x307B, any, "Pn503, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x307C, any,
     "Pn504, in steps of 256 pulses; the CANopen manual does not say what for. Kept, without effect here."},
    {0x307D, any,
     "Pn505, in ms, the only signed one; the CANopen manual does not say what for. Kept, without effect here."},
    {0x307E, any, "Pn506, in steps of 10 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x307F, any, "Pn507, in rpm; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3080, any, "Pn508, in steps of 10 ms; the CANopen manual does not say what for. Kept, without effect here."},
    {0x3081, any,
     "Functions of the terminals CN1_14 to CN1_17, one hex digit each from the lowest: 2 positive limit, 3 negative "
     "limit, C home switch. Other codes do nothing here."},
    {0x3082, any,
     "Functions of the terminals CN1_39 to CN1_42, one hex digit each from the lowest: 2 positive limit, 3 negative "
     "limit, C home switch. Other codes do nothing here."},
    {0x3083, any, "Pn511; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x3084, any,
     "Terminals CN1_14 to CN1_17 that the master sets through 60FEh:01 instead of the wire, one hex digit each from "
     "the lowest: 0 wire, otherwise bus."},
    {0x3085, any,
     "Terminals CN1_39 to CN1_42 that the master sets through 60FEh:01 instead of the wire, one hex digit each from "
     "the lowest: 0 wire, otherwise bus."},
    {0x3086, any,
     "Pn514: here the filter of the input terminals in steps of 0.2 ms; shorter levels are ignored, and 0 is no "
     "filter. The manual gives only the unit."},
    {0x3088, any,
     "Sense of the terminals CN1_14 to CN1_17, one hex digit each from the lowest: 0 active while high, otherwise "
     "inverted."},
    {0x3089, any,
     "Sense of the terminals CN1_39 to CN1_42, one hex digit each from the lowest: 0 active while high, otherwise "
     "inverted."},
    {0x3091, any, "Pn525, in %; the CANopen manual does not say what for. Kept, without effect here."},
    {0x30FC, any, "Pn700; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x30FD, any, "Pn701; the CANopen manual gives neither purpose nor unit. Kept, without effect here."},
    {0x30FF, any,
     "Bit rate of CAN in the lowest hex digit: 0 50 kbit/s, 1 100, 2 125, 3 250, 4 500, 5 1 Mbit/s; other digits are "
     "reserved. Acts after a restart."},
    {0x3100, any, "Node-ID on CANopen, 1 to 127; with any other value the drive keeps silent. Acts after a restart."},
    {0x3200, any,
     "Newest entry of the drive's own record of alarms and warnings: the emergency code, 69h for A 69. 0: none."},
    {0x3201, any, "Record of alarms and warnings, one entry before the newest. 0: none."},
    {0x3202, any, "Record of alarms and warnings, two entries before the newest. 0: none."},
    {0x3203, any, "Record of alarms and warnings, three entries before the newest. 0: none."},
    {0x3204, any, "Record of alarms and warnings, four entries before the newest. 0: none."},
    {0x3205, any, "Record of alarms and warnings, five entries before the newest. 0: none."},
    {0x3206, any, "Record of alarms and warnings, six entries before the newest. 0: none."},
    {0x3207, any, "Record of alarms and warnings, seven entries before the newest. 0: none."},
    {0x3208, any, "Record of alarms and warnings, eight entries before the newest. 0: none."},
    {0x3209, any, "Oldest of the ten entries of the drive's own record of alarms and warnings. 0: none."},
    {0x320A, any, "Un000: here the motor's actual speed in rpm, to be read as signed; the manual gives only the unit."},
    {0x320B, any,
     "Un001: here the speed demand of the trajectory, in rpm, as a signed number; the manual gives only the unit."},
    {0x320C, any,
     "Un002: here the torque that the loops ask for, in % of the rated torque, to be read as signed; the manual gives "
     "only the unit."},
    {0x320D, any,
     "Un003: here the actual torque in % of the rated torque, to be read as signed; the manual gives only the unit."},
    {0x320E, any,
     "Un004: here the position within the turn in encoder counts, the low 16 bits; the manual gives only the unit."},
    {0x320F, any,
     "Un005: here the levels of the input terminals after bus and filter, bits 0 to 3 for CN1_14 to CN1_17, 4 to 7 for "
     "CN1_39 to CN1_42."},
    {0x3210, any, "Un006, a value to watch; the manual gives neither meaning nor unit. Always 0 here."},
    {0x3211, any, "Un007, a value to watch; the manual gives neither meaning nor unit. Always 0 here."},
    {0x3212, any, "Un008, in kHz; the manual does not say of what. Always 0 here."},
    {0x3213, any,
     "Un009: here the following error in encoder counts, the low 16 bits, to be read as signed; the manual gives only "
     "the unit."},
    {0x3214, any, "Un010, a value to watch; the manual gives neither meaning nor unit. Always 0 here."},
    {0x3215, any, "Un011, a value to watch; the manual gives neither meaning nor unit. Always 0 here."},
    {0x3216, any, "Un012, a value to watch; the manual gives neither meaning nor unit. Always 0 here."},
    {0x3217, any, "Un013, a value to watch; the manual gives neither meaning nor unit. Always 0 here."},
    {0x3218, any, "Un014, a value to watch; the manual gives neither meaning nor unit. Always 0 here."},
    {0x321E, any, "Edition of the drive's firmware."},
    {0x3300, any, "Whole turns of the encoder, the low 16 bits, to be read as signed."},
    {0x3301, any, "Position within the turn in encoder counts. A 17-bit encoder shows only its low 16 bits."},
    {0x603F, any,
     "Code of the latest alarm, as in its emergency message; A 69 of the panel is 8169h. Warnings leave it alone. "
     "`faults` of the axis explains it."},
    {0x6040, any,
     "Commands of the master: bits 0 to 3 and 7 lead through the power states, bit 8 halts, bits 4 to 6 belong to the "
     "mode of operation. The others are reserved."},
    {0x6041, any,
     "State of the drive: bits 0 to 3, 5 and 6 are the power state, 4 main power, 7 an alarm or warning, 10 target "
     "reached, 11 torque limit or limit switch; 12, 13 belong to the mode; 8, 9, 14, 15 stay 0."},
    {0x605A, any,
     "Braking of a quick stop: 0 power off, which is the factory value, 1 and 2 brake with 6084h or 6085h and switch "
     "off, 5 and 6 brake likewise and hold in quick stop active."},
    {0x605D, any,
     "Braking of a halt (controlword bit 8): 1 slow down ramp, 2 quick stop ramp. The factory value 0 acts as 1 and "
     "cannot be written."},
    {0x605E, any, "Reaction to an alarm. Only 0 is allowed: power off, and the motor coasts."},
    {0x6060, any,
     "Mode of operation that the master requests: 0 none, no motion, 1 profile position, 3 profile velocity, 6 homing, "
     "7 interpolated position. 6061h shows the one in force."},
    {0x6065, any,
     "Distance between demand and actual position beyond which the following error counts. It sets statusword bit 13 "
     "in profile position and raises no alarm."},
    {0x6069, any, "Actual speed as the drive counts it, in 0.1 rpm; 6094h does not act on it."},
    {0x607C, any,
     "Home offset: from home to the zero of the position, in position units. After homing 6064h is -607Ch at the point "
     "that was found; the axis does not travel."},
    {0x6083, any,
     "Acceleration of the profile modes, in acceleration units (0.1 rpm/s from the factory). With S-curve ramps it "
     "limits braking too."},
    {0x6085, any,
     "Deceleration of the quick stop ramp: for 605Ah 2 and 6, 605Dh 2, and at limit switches outside homing. In "
     "acceleration units."},
    {0x6086, any,
     "Shape of the ramps: 0 trapezoidal, 2 S-curve with the jerk of 60A4h. With 2, set-points are taken only one after "
     "the other, and ramps are symmetric."},
    {0x6093, any,
     "Position factor: increments = position units * numerator / divisor. Loaded from Pn201 and Pn202 at power-on; "
     "cannot be changed while the motor has power."},
    {0x6094, any,
     "Velocity factor: 0.1 rpm = velocity units * numerator / divisor. Cannot be changed while the motor has power."},
    {0x6097, any,
     "Acceleration factor: 0.1 rpm/s = acceleration units * numerator / divisor. Cannot be changed while the motor has "
     "power."},
    {0x6099, 0x01,
     "Fast speed, of the search for the switch. 0 from the factory: homing then sets statusword bit 13 and does not "
     "move, except with method 35."},
    {0x6099, 0x02,
     "Speed at which the edge or index that decides is crossed: the slow one. 0 from the factory: homing then sets "
     "statusword bit 13 and does not move, but for method 35."},
    {0x609A, any,
     "Acceleration and deceleration during homing. 0 from the factory: homing then sets statusword bit 13 and does not "
     "move, but for method 35."},
    {0x60A4, any,
     "Jerk of S-curve ramps, 1 to 20, in units of 100 million increments per second cubed; smaller is smoother."},
    {0x60C1, any,
     "The next point of interpolated position. There is no buffer: each write replaces the last, and SYNC takes it "
     "over."},
    {0x60C1, 0x01,
     "Absolute position for the next period, in position units. Write it before every SYNC, best in a synchronous "
     "PDO."},
    {0x60C1, 0x02, "Kept, but interpolated position does not use it."},
    {0x60C2, any,
     "Time from one point of the master to the next: sub-index 1 in units of ten to the power of sub-index 2 seconds. "
     "Set 2105h to the same time, SYNC no slower."},
    {0x60FD, any,
     "Signals of the inputs after Pn509 to Pn517: bit 0 negative limit switch, 1 positive limit switch, 2 home switch. "
     "The others stay 0."},
    {0x60FE, any,
     "Inputs that the master sets over the bus, for switches that are wired to the master. The drive has no outputs "
     "here."},
    {0x60FE, 0x01,
     "Levels of terminals that Pn512 and Pn513 give to the bus: bits 24 to 27 for CN1_14 to CN1_17, 28 to 31 for "
     "CN1_39 to CN1_42."},
    {0x60FE, 0x02, "Kept, but it masks nothing; Pn512 and Pn513 choose the terminals."},
});

}  // namespace servodrome::catalogue::pronet
