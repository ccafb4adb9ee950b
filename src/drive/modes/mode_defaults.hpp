#pragma once

#include "drive/axis.hpp"

namespace servodrome::drive {

// What most modes of operation do; a mode declares only the functions in which it differs.
class ModeDefaults {
 public:
  void controlword(Axis&, std::uint16_t, std::uint16_t) {}
  void halt(Axis&) {}
  void interrupt(Axis&, int) {}
  double deceleration(const Axis& axis) const { return axis.profile_deceleration(); }
};

}  // namespace servodrome::drive
