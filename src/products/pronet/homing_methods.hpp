#pragma once

#include <array>

#include "drive/homing/cia402_methods.hpp"

// The homing methods of the ProNet drive (ch. 7.2). They run as the figures of CiA 402 do, and end where the ramp
// after the found point ends: no travel back to it is described.
//
// Method 3, 4, 19, 20: table ch. 7.2.3, 6098h, text ch. 7.2.4, methods 3 and 4 and note ch. 7.2.4 contradict each other
// about the direction. Here the axis starts towards the switch, positive when it is inactive and negative when it is
// active; 3 and 19 find their point running negative, 4 and 20 running positive (C19). Method 17 to 20 have one text
// (ch. 7.2.4, methods 17 to 20).
namespace servodrome::products::pronet {

// "Afterwards the drive slowly returns" (ch. 7.2.4, methods 17 to 20): off the switch, too, before the edge is taken.
inline constexpr drive::Method method_4 = [] {
  drive::Method method = drive::cia402::method_4;
  method.legs[1].speed = drive::HomingSpeed::slow;
  return method;
}();

inline constexpr std::array homing_methods = [] {
  namespace cia402 = drive::cia402;
  using drive::mirrored;
  using drive::without_index;
  using drive::without_return;
  return std::array{
      without_return(cia402::method_1),                     // ch. 7.2.4
      without_return(mirrored(2, cia402::method_1)),        // ch. 7.2.4, method 2
      without_return(cia402::method_3),                     // ch. 7.2.4, methods 3 and 4
      without_return(method_4),                             // and slowly back (ch. 7.2.4, methods 17 to 20)
      without_return(without_index(17, cia402::method_1)),  // ch. 7.2.4, methods 17 to 20
      without_return(without_index(18, mirrored(2, cia402::method_1))),
      without_return(without_index(19, cia402::method_3)),
      without_return(without_index(20, method_4)),
      drive::present_position(35),  // ch. 7.2.4, method 35, not in the printed range (C18)
  };
}();
static_assert(drive::are_well_formed(homing_methods));

}  // namespace servodrome::products::pronet
