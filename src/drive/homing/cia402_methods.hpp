#pragma once

#include "drive/homing/methods.hpp"

// The homing methods of CiA 402-2 (IEC 61800-7-201) "Functional description" of the homing mode, figures of methods 1
// to 37, and hard-stop methods in the manufacturer's range. Home is the edge or index of the figure, approached in the
// figure's direction.
//
// Where the standard leaves a choice, the reference drive behaves as follows:
// - The axis searches the switch at fast speed (6099h sub 1). It crosses the edge that determines home, and the index
//   after it, at slow speed (sub 2). If it met that edge at fast speed, it backs off and approaches it again slowly.
// - After the latch the axis decelerates and moves back to the latched position: at rest the position actual value is
//   the home position.
// - Methods 7 to 14 and 23 to 30 turn round at the limit switch in their initial direction. Any other limit switch
//   ahead ends homing with an error.
// - 15, 16, 31, 32 and 36 are reserved in the standard and absent here. 35 is obsolete there in favour of 37 and does
//   the same.
namespace servodrome::drive {
namespace cia402 {

inline constexpr auto negative = Direction::negative;
inline constexpr auto positive = Direction::positive;
inline constexpr auto fast = HomingSpeed::fast;
inline constexpr auto slow = HomingSpeed::slow;
inline constexpr bool and_return = true;

inline constexpr Leg to_index_negative = leg(negative, slow, Until::index, Then::latch);
inline constexpr Leg to_index_positive = leg(positive, slow, Until::index, Then::latch);

// Negative limit switch: first index on the positive side of the point where it becomes inactive.
inline constexpr Method method_1 =
    make_method(1,
                {leg(negative, fast, Until::limit_reached, Then::stop),
                 leg(positive, slow, Until::limit_released, Then::keep), to_index_positive},
                0, and_return);

// Home switch that stays active up to the positive end: first index on its negative side, outside.
inline constexpr Method method_3 =
    make_method(3,
                {leg(positive, fast, Until::home_rising, Then::stop),
                 leg(negative, slow, Until::home_falling, Then::keep), to_index_negative},
                1, and_return);

// The same switch as method 3: first index on the positive side of its edge, inside.
inline constexpr Method method_4 = make_method(
    4,
    {leg(positive, fast, Until::home_rising, Then::stop), leg(negative, fast, Until::home_falling, Then::stop),
     leg(positive, slow, Until::home_rising, Then::keep), to_index_positive},
    1, and_return);

// Home switch as a cam in the middle, initial direction positive. The four indexes: outside and inside of its negative
// edge, inside and outside of its positive edge.
inline constexpr Method method_7 = make_method(
    7,
    {leg(positive, fast, Until::home_rising, Then::stop, 2, 1), leg(negative, fast, Until::home_rising, Then::keep),
     leg(negative, slow, Until::home_falling, Then::keep), to_index_negative},
    2, and_return);

inline constexpr Method method_8 = make_method(
    8,
    {leg(positive, fast, Until::home_rising, Then::stop, 1, 1), leg(negative, fast, Until::home_falling, Then::stop),
     leg(positive, slow, Until::home_rising, Then::keep), to_index_positive},
    1, and_return);

inline constexpr Method method_9 = make_method(
    9,
    {leg(positive, fast, Until::home_falling, Then::stop, 3, 1), leg(negative, fast, Until::home_rising, Then::stop),
     leg(positive, fast, Until::home_falling, Then::stop), leg(negative, slow, Until::home_rising, Then::keep),
     to_index_negative},
    0, and_return);

inline constexpr Method method_10 = make_method(
    10,
    {leg(positive, fast, Until::home_rising, Then::keep, 2, 1), leg(negative, fast, Until::home_rising, Then::stop),
     leg(positive, slow, Until::home_falling, Then::keep), to_index_positive},
    2, and_return);

// First index in negative direction.
inline constexpr Method method_33 = make_method(33, {to_index_negative}, 0, and_return);

// Hard stop in negative direction: home is that point, or the point at the retraction distance in front of it.
inline constexpr Method method_hard_stop = make_method(
    -1, {leg(negative, fast, Until::stalled, Then::hold), leg(positive, slow, Until::retracted, Then::latch)});

// Hard stop in negative direction, then the first index in positive direction.
inline constexpr Method method_hard_stop_index =
    make_method(-3, {leg(negative, fast, Until::stalled, Then::hold), to_index_positive}, 0, and_return);

}  // namespace cia402

inline constexpr std::array cia402_methods{
    mirrored(-4, cia402::method_hard_stop_index),
    cia402::method_hard_stop_index,
    mirrored(-2, cia402::method_hard_stop),
    cia402::method_hard_stop,
    cia402::method_1,
    mirrored(2, cia402::method_1),
    cia402::method_3,
    cia402::method_4,
    mirrored(5, cia402::method_3),
    mirrored(6, cia402::method_4),
    cia402::method_7,
    cia402::method_8,
    cia402::method_9,
    cia402::method_10,
    mirrored(11, cia402::method_7),
    mirrored(12, cia402::method_8),
    mirrored(13, cia402::method_9),
    mirrored(14, cia402::method_10),
    without_index(17, cia402::method_1),
    without_index(18, mirrored(2, cia402::method_1)),
    without_index(19, cia402::method_3),
    without_index(20, cia402::method_4),
    without_index(21, mirrored(5, cia402::method_3)),
    without_index(22, mirrored(6, cia402::method_4)),
    without_index(23, cia402::method_7),
    without_index(24, cia402::method_8),
    without_index(25, cia402::method_9),
    without_index(26, cia402::method_10),
    without_index(27, mirrored(11, cia402::method_7)),
    without_index(28, mirrored(12, cia402::method_8)),
    without_index(29, mirrored(13, cia402::method_9)),
    without_index(30, mirrored(14, cia402::method_10)),
    cia402::method_33,
    mirrored(34, cia402::method_33),
    present_position(35),
    present_position(37),
};
static_assert(are_well_formed(cia402_methods));

}  // namespace servodrome::drive
