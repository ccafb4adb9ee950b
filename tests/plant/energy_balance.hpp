#pragma once

#include <gtest/gtest.h>

#include "plant/rig.hpp"

namespace servodrome::plant::test {

// The book of three seconds: what the supply gave is found as heat, friction and what is still stored. `step` makes one
// tick, at an angle of the command (0.8 Hz); at least `least_j` go through the motor.
template <typename Step>
void expect_energy_balance(const Parameters& parameters, double least_j, const Step& step) {
  Rig rig(parameters);
  const Energy start = rig.plant.energy();
  double friction = 0.0;
  for (int tick = 0; tick < 48000; ++tick) {
    const double before = rig.speed_rad_s();
    step(rig, tick, 2.0 * std::numbers::pi * 0.8 * tick * h);
    const double mean = 0.5 * (before + rig.speed_rad_s());
    friction += parameters.load.viscous_friction_nms * mean * mean * h;
  }
  const Energy end = rig.plant.energy();
  const double electric = end.to_motor_j - end.copper_j - end.shaft_j - (end.magnetic_j - start.magnetic_j);
  const double mechanic = end.shaft_j - friction - (end.kinetic_j - start.kinetic_j);
  const double link = end.supplied_j - end.chopped_j - end.standby_j - end.stage_j - end.to_motor_j -
                      (end.link_stored_j - start.link_stored_j);
  EXPECT_GT(end.to_motor_j, least_j);
  EXPECT_NEAR(electric, 0.0, 1.0e-3 * end.to_motor_j);
  EXPECT_NEAR(mechanic, 0.0, 1.0e-4 * end.to_motor_j);
  EXPECT_NEAR(link, 0.0, 1.0e-5 * end.to_motor_j);
}

}  // namespace servodrome::plant::test
