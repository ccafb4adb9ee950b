#pragma once

#include <array>

#include "drive/homing/methods.hpp"

// The homing methods of the ISMC drive, as the text of its manual has them (ch. 4.7.6), row by row: the speed of each
// leg, where the axis slows down without stopping, where it returns. Fast is 6099h sub 1, slow is sub 2. Methods 14 and
// 23 of the manual exchange the two, and methods 27 and 30 speed up again after the axis slowed down: these methods
// have the speeds of the neighbouring rows instead (G36).
//
// Not supported: 0 (Table 4-80), 15, 16, 31, 32 (reserved, ch. 4.7.6) and every other number that is absent here, 37
// included.
namespace servodrome::products::ismc {
namespace homing {

using drive::leg;
using drive::make_method;
using drive::present_position;
using drive::Then;
using drive::Until;

inline constexpr auto negative = drive::Direction::negative;
inline constexpr auto positive = drive::Direction::positive;
inline constexpr auto fast = drive::HomingSpeed::fast;
inline constexpr auto slow = drive::HomingSpeed::slow;
inline constexpr bool and_return = true;

inline constexpr drive::Leg to_index_negative = leg(negative, slow, Until::index, Then::latch);
inline constexpr drive::Leg to_index_positive = leg(positive, slow, Until::index, Then::latch);

}  // namespace homing

inline constexpr std::array homing_methods = [] {
  using namespace homing;
  return std::array{
      // Hard stop. The manual prints no speeds: the axis is fast towards the stop and slow away from it.
      make_method(-4, {leg(positive, fast, Until::stalled, Then::hold), to_index_negative}),
      make_method(-3, {leg(negative, fast, Until::stalled, Then::hold), to_index_positive}),
      make_method(
          -2, {leg(positive, fast, Until::stalled, Then::hold), leg(negative, slow, Until::retracted, Then::latch)}),
      make_method(
          -1, {leg(negative, fast, Until::stalled, Then::hold), leg(positive, slow, Until::retracted, Then::latch)}),

      // Limit switch, then index. The manual does not describe a start on the switch; here the first leg ends at once.
      make_method(1, {leg(negative, fast, Until::limit_reached, Then::stop),
                      leg(positive, slow, Until::limit_released, Then::keep), to_index_positive}),
      make_method(2, {leg(positive, fast, Until::limit_reached, Then::stop),
                      leg(negative, slow, Until::limit_released, Then::keep), to_index_negative}),

      // Home switch, then index, without limit detection. Only 4 and 5 return to the index (ch. 4.7.6, G24).
      make_method(3,
                  {leg(positive, fast, Until::home_rising, Then::stop),
                   leg(negative, slow, Until::home_falling, Then::keep), to_index_negative},
                  1),
      make_method(
          4,
          {leg(positive, slow, Until::home_rising, Then::keep, 3), leg(negative, fast, Until::home_falling, Then::stop),
           leg(positive, slow, Until::home_rising, Then::keep), to_index_positive},
          1, and_return),
      make_method(5,
                  {leg(negative, fast, Until::home_rising, Then::stop),
                   leg(positive, slow, Until::home_falling, Then::keep), to_index_positive},
                  1, and_return),
      make_method(
          6,
          {leg(negative, slow, Until::home_rising, Then::keep, 3), leg(positive, fast, Until::home_falling, Then::stop),
           leg(negative, slow, Until::home_rising, Then::keep), to_index_negative},
          1),

      // Home switch with limit detection, then index.
      make_method(7,
                  {leg(positive, fast, Until::home_rising, Then::stop, 2, 1),
                   leg(negative, fast, Until::home_rising, Then::keep),
                   leg(negative, slow, Until::home_falling, Then::keep), to_index_negative},
                  2),
      make_method(8,
                  {leg(positive, slow, Until::home_rising, Then::keep, 3, 1),
                   leg(negative, fast, Until::home_falling, Then::stop),
                   leg(positive, slow, Until::home_rising, Then::keep), to_index_positive},
                  1),
      make_method(9,
                  {leg(positive, fast, Until::home_rising, Then::keep, 1, 2),
                   leg(positive, fast, Until::home_falling, Then::stop),
                   leg(negative, slow, Until::home_rising, Then::keep),  // slow all the way from the limit
                   to_index_negative},
                  1),
      make_method(10,
                  {leg(positive, fast, Until::home_rising, Then::keep, 2, 1),
                   leg(negative, fast, Until::home_rising, Then::stop),
                   leg(positive, slow, Until::home_falling, Then::keep), to_index_positive},
                  2),
      make_method(11,
                  {leg(negative, fast, Until::home_rising, Then::stop, 2, 1),
                   leg(positive, fast, Until::home_rising, Then::keep),
                   leg(positive, slow, Until::home_falling, Then::keep), to_index_positive},
                  2),
      make_method(12,
                  {leg(negative, slow, Until::home_rising, Then::keep, 3, 1),
                   leg(positive, fast, Until::home_falling, Then::stop),
                   leg(negative, slow, Until::home_rising, Then::keep), to_index_negative},
                  1),
      make_method(13,
                  {leg(negative, fast, Until::home_rising, Then::keep, 1, 2),
                   leg(negative, fast, Until::home_falling, Then::stop),
                   leg(positive, slow, Until::home_rising, Then::keep),  // slow all the way from the limit
                   to_index_positive},
                  1),
      make_method(14,
                  {leg(negative, fast, Until::home_rising, Then::keep, 2, 1),
                   leg(positive, fast, Until::home_rising, Then::stop),
                   leg(negative, slow, Until::home_falling, Then::keep), to_index_negative},
                  2),

      // Limit switch.
      make_method(17, {leg(negative, fast, Until::limit_reached, Then::stop),
                       leg(positive, slow, Until::limit_released, Then::latch)}),
      make_method(18, {leg(positive, fast, Until::limit_reached, Then::stop),
                       leg(negative, slow, Until::limit_released, Then::latch)}),

      // Home switch without limit detection.
      make_method(
          19,
          {leg(positive, fast, Until::home_rising, Then::stop), leg(negative, slow, Until::home_falling, Then::latch)},
          1),
      make_method(
          20,
          {leg(positive, slow, Until::home_rising, Then::latch), leg(negative, fast, Until::home_falling, Then::stop),
           leg(positive, slow, Until::home_rising, Then::latch)},
          1),
      make_method(
          21,
          {leg(negative, fast, Until::home_rising, Then::stop), leg(positive, slow, Until::home_falling, Then::latch)},
          1),
      make_method(
          22,
          {leg(negative, slow, Until::home_rising, Then::latch), leg(positive, fast, Until::home_falling, Then::stop),
           leg(negative, slow, Until::home_rising, Then::latch)},
          1),

      // Home switch with limit detection.
      make_method(
          23,
          {leg(positive, fast, Until::home_rising, Then::stop, 2, 1),
           leg(negative, fast, Until::home_rising, Then::keep), leg(negative, slow, Until::home_falling, Then::latch)},
          2),
      make_method(
          24,
          {leg(positive, slow, Until::home_rising, Then::latch, drive::no_leg, 1),
           leg(negative, fast, Until::home_falling, Then::stop), leg(positive, slow, Until::home_rising, Then::latch)},
          1),
      make_method(25, {leg(positive, fast, Until::home_falling, Then::stop, 1, 1),  // for any level of the switch
                       leg(negative, slow, Until::home_rising, Then::latch)}),
      make_method(
          26,
          {leg(positive, fast, Until::home_rising, Then::keep, 2, 1),
           leg(negative, fast, Until::home_rising, Then::stop), leg(positive, slow, Until::home_falling, Then::latch)},
          2),
      make_method(
          27,
          {leg(negative, fast, Until::home_rising, Then::stop, 2, 1),
           leg(positive, fast, Until::home_rising, Then::keep), leg(positive, slow, Until::home_falling, Then::latch)},
          2),
      make_method(
          28,
          {leg(negative, slow, Until::home_rising, Then::latch, drive::no_leg, 1),
           leg(positive, fast, Until::home_falling, Then::stop), leg(negative, slow, Until::home_rising, Then::latch)},
          1),
      make_method(29, {leg(negative, fast, Until::home_falling, Then::stop, 1, 1),  // for any level of the switch
                       leg(positive, slow, Until::home_rising, Then::latch)}),
      make_method(
          30,
          {leg(negative, fast, Until::home_rising, Then::keep, 2, 1),
           leg(positive, fast, Until::home_rising, Then::stop), leg(negative, slow, Until::home_falling, Then::latch)},
          2),

      make_method(33, {to_index_negative}),
      make_method(34, {to_index_positive}),
      present_position(35),
  };
}();
static_assert(drive::are_well_formed(homing_methods));

}  // namespace servodrome::products::ismc
