#pragma once

#include "drive/modes/mode_defaults.hpp"

namespace servodrome::drive {

// Mode 0: no mode assigned. The axis comes to rest and holds its position.
class NoMode : public ModeDefaults {
 public:
  static constexpr Loop loop = Loop::position;

  void enter(Axis& axis) { axis.come_to_rest(RampShape::linear); }
  void step(Axis& axis) {
    axis.rest_within_limits();
    axis.generator.step(axis.cycle_s);
    axis.follow_generator(loop);
  }
  void resume(Axis& axis) { enter(axis); }
  std::uint16_t status(const Axis&) const { return 0; }
};

}  // namespace servodrome::drive
