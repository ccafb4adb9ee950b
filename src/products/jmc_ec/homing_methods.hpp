#pragma once

#include <array>

#include "drive/homing/cia402_methods.hpp"

// The homing methods of the JMC EC drives as the manual describes them (HM 2), row by row. CW is positive (routine for
// CoDeSys, 'Speed mode'). Fast is 6099h sub 1, slow is sub 2. Where the text is missing or wrong, the method follows
// the row with the same edge and side (D-22):
// - Methods 3 to 6 turn round at the limit switch as 7 to 14 do (HM 2.3 to 2.6): 3 = 7, 4 = 8, 5 = 11, 6 = 12.
// - Methods 19 to 30 are 3 to 14 without the index, also where their own text is missing or differs (HM 2.19, 2.23,
//   2.25, 2.27 and 2.28).
// - The axis is slow from the first event of the home or limit switch on; from a limit switch back to the home switch
//   it may be fast. An edge that is met at fast speed counts, unlike in CiA 402's figures: its position is captured,
//   and the axis slows down behind it (HM 2.4 and 2.20).
// - Zero is the position of the edge or index, not where the axis stops behind it (HM 2.1).
// - 0 is no homing; 15, 16, 31 and 32 are reserved. They may be chosen, and have no effect (object 6098h).
namespace servodrome::products::jmc_ec {

namespace homing {

using drive::leg;
using drive::make_method;
using drive::mirrored;
using drive::Then;
using drive::Until;
using drive::without_index;
using drive::cia402::and_return;
using drive::cia402::fast;
using drive::cia402::negative;
using drive::cia402::positive;
using drive::cia402::slow;
using drive::cia402::to_index_negative;
using drive::cia402::to_index_positive;

inline constexpr drive::Method limit = drive::cia402::method_1;
inline constexpr drive::Method left_outside = drive::cia402::method_7;  // left edge, index outside (HM 2.3)

// Left edge, index inside (HM 2.4 and 2.8).
inline constexpr drive::Method left_inside = make_method(
    4,
    {leg(positive, fast, Until::home_rising, Then::keep, 4, 1), leg(negative, fast, Until::home_rising, Then::keep),
     leg(negative, slow, Until::home_falling, Then::stop), leg(positive, slow, Until::home_rising, Then::keep),
     to_index_positive},
    2, and_return);

// Right edge, index inside (HM 2.9).
inline constexpr drive::Method right_inside = make_method(
    9,
    {leg(positive, fast, Until::home_rising, Then::keep, 1, 3), leg(positive, slow, Until::home_falling, Then::stop),
     leg(negative, slow, Until::home_rising, Then::keep, 4), leg(negative, fast, Until::home_rising, Then::keep),
     to_index_negative},
    1, and_return);

inline constexpr drive::Method right_outside = drive::cia402::method_10;  // right edge, index outside (HM 2.10)

constexpr drive::Method numbered(std::int8_t number, drive::Method method) {
  method.number = number;
  return method;
}

}  // namespace homing

inline constexpr auto homing_methods = [] {
  using namespace homing;
  return std::array{
      drive::no_homing(0),
      limit,
      mirrored(2, limit),
      numbered(3, left_outside),
      left_inside,
      mirrored(5, left_outside),
      mirrored(6, left_inside),
      left_outside,
      numbered(8, left_inside),
      right_inside,
      right_outside,
      mirrored(11, left_outside),
      mirrored(12, left_inside),
      mirrored(13, right_inside),
      mirrored(14, right_outside),
      drive::no_homing(15),
      drive::no_homing(16),
      without_index(17, limit),
      without_index(18, mirrored(2, limit)),
      without_index(19, left_outside),
      without_index(20, left_inside),
      without_index(21, mirrored(5, left_outside)),
      without_index(22, mirrored(6, left_inside)),
      without_index(23, left_outside),
      without_index(24, left_inside),
      without_index(25, right_inside),
      without_index(26, right_outside),
      without_index(27, mirrored(11, left_outside)),
      without_index(28, mirrored(12, left_inside)),
      without_index(29, mirrored(13, right_inside)),
      without_index(30, mirrored(14, right_outside)),
      drive::no_homing(31),
      drive::no_homing(32),
      drive::cia402::method_33,
      mirrored(34, drive::cia402::method_33),
      drive::without_offset(drive::present_position(35)),  // HM 2.35: the present point, so nothing is travelled
  };
}();
static_assert(drive::are_well_formed(homing_methods));
static_assert(homing_methods.size() == 36);

}  // namespace servodrome::products::jmc_ec
