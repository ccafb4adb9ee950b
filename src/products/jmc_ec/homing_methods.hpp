#pragma once

#include <array>

#include "drive/homing/cia402_methods.hpp"

// The homing methods of the JMC EC drives as their text has them (L4119-4576), row by row. CW is positive (L5376). Fast
// is 6099h sub 1, slow sub 2. What the text leaves out is taken from the row with the same edge and side:
// - Methods 3 to 6 turn round at the limit switch as 7 to 14 do (L4155, L4170, L4181, L4195): 3 = 7, 4 = 8, 5 = 11,
//   6 = 12, and 19 to 30 are 3 to 14 without the index, also where their own text is missing or says otherwise (19
//   L4366, 23 L4422, 25 L4458, 27 L4490, 28 L4505).
// - From the first event of the home or limit switch on the axis is slow; back from a limit switch to the home switch
//   it may be fast. An edge met at fast speed counts, other than in CiA 402's figures: its position is captured, and
//   the axis slows down behind it (4 L4165, 20 L4377).
// - Zero is where the edge or index is, not where the axis comes to rest behind it (L4127).
// - 0 is no homing, 15, 16, 31 and 32 are reserved: they may be chosen, and nothing happens (L2858, L4328, L4544).
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

inline constexpr drive::Method limit = drive::cia402::method_1;         // L4121-4130
inline constexpr drive::Method left_outside = drive::cia402::method_7;  // left edge, index outside (L4144-4157)

// Left edge, index inside (L4159-4172, L4219-4232).
inline constexpr drive::Method left_inside = make_method(
    4,
    {leg(positive, fast, Until::home_rising, Then::keep, 4, 1), leg(negative, fast, Until::home_rising, Then::keep),
     leg(negative, slow, Until::home_falling, Then::stop), leg(positive, slow, Until::home_rising, Then::keep),
     to_index_positive},
    2, and_return);

// Right edge, index inside (L4234-4247).
inline constexpr drive::Method right_inside = make_method(
    9,
    {leg(positive, fast, Until::home_rising, Then::keep, 1, 3), leg(positive, slow, Until::home_falling, Then::stop),
     leg(negative, slow, Until::home_rising, Then::keep, 4), leg(negative, fast, Until::home_rising, Then::keep),
     to_index_negative},
    1, and_return);

inline constexpr drive::Method right_outside = drive::cia402::method_10;  // right edge, index outside (L4249-4262)

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
      drive::without_offset(drive::present_position(35)),  // L4572-4576: the present point, so nothing is travelled
  };
}();
static_assert(drive::are_well_formed(homing_methods));
static_assert(homing_methods.size() == 36);

}  // namespace servodrome::products::jmc_ec
