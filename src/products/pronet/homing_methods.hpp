#pragma once

#include <array>

#include "drive/homing/cia402_methods.hpp"

// The homing methods of the ProNet drive (ch. 7.2). They follow the figures of CiA 402. The axis stays where its ramp
// after the found point ends, because the manual describes no travel back.
//
// Methods 3, 4, 19, 20: the table in ch. 7.2.3 and the text and note of ch. 7.2.4 contradict each other about the
// direction. Here the axis starts in positive direction when the switch is inactive and in negative direction when it
// is active; 3 and 19 find their point in negative direction, 4 and 20 in positive direction (C19). Methods 17 to 20
// share one text in ch. 7.2.4.
namespace servodrome::products::pronet {

// "Afterwards the drive slowly returns" (ch. 7.2.4, methods 17 to 20). Method 4 therefore also leaves the switch slowly
// before it uses the edge (C18a).
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
      without_return(method_4),                             // and slowly back
      without_return(without_index(17, cia402::method_1)),  // ch. 7.2.4, methods 17 to 20
      without_return(without_index(18, mirrored(2, cia402::method_1))),
      without_return(without_index(19, cia402::method_3)),
      without_return(without_index(20, method_4)),
      drive::present_position(35),  // ch. 7.2.4, method 35, not in the printed range (C18)
  };
}();
static_assert(drive::are_well_formed(homing_methods));

}  // namespace servodrome::products::pronet
