#pragma once

#include "drive/axis.hpp"

namespace servodrome::drive {

// Mode 0: no mode assigned. The axis comes to rest and holds its position.
class NoMode {
 public:
  static constexpr Loop loop = Loop::position;

  void enter(Axis& axis) { axis.come_to_rest(RampShape::linear); }
  void controlword(Axis&, std::uint16_t, std::uint16_t) {}
  void step(Axis& axis) {
    axis.rest_within_limits();
    axis.generator.step(axis.cycle_s);
    axis.follow_generator(loop);
  }
  void halt(Axis&) {}
  void resume(Axis& axis) { enter(axis); }
  void interrupt(Axis&, int) {}
  double deceleration(const Axis& axis) const { return axis.profile_deceleration(); }
  std::uint16_t status(const Axis&) const { return 0; }
};

}  // namespace servodrome::drive
