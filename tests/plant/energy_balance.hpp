#pragma once

#include <gtest/gtest.h>

#include "plant/rig.hpp"

namespace servodrome::plant::test {

// Work of friction and coupling in a tick, from the motion of rotor and load.
class Dissipation {
 public:
  explicit Dissipation(const Plant& plant) : p_(plant.parameters()) { note(plant); }
  void add(const Plant& plant) {
    const double rotor = rotor_;
    const double load = load_;
    note(plant);
    const double rotor_rad_s = (rotor_ - rotor) * rad_s_per_count_tick();
    const double load_rad_s = (load_ - load) * rad_s_per_count_tick();
    const double twist_rad_s = rotor_rad_s - load_rad_s;
    double sliding_nm = p_.load.coulomb_friction_nm;
    if (p_.load.stribeck_speed_rad_s > 0.0) {
      const double ratio = load_rad_s / p_.load.stribeck_speed_rad_s;
      sliding_nm += (p_.load.static_friction_nm - sliding_nm) * std::exp(-ratio * ratio);
    }
    sum_j_ += h * (p_.motor.coulomb_friction_nm * std::abs(rotor_rad_s) + sliding_nm * std::abs(load_rad_s) +
                   p_.motor.viscous_friction_nms * rotor_rad_s * rotor_rad_s +
                   p_.load.viscous_friction_nms * load_rad_s * load_rad_s);
    if (p_.load.elastic) sum_j_ += h * p_.load.damping_nms * twist_rad_s * twist_rad_s;
  }
  double sum_j() const { return sum_j_; }

 private:
  double rad_s_per_count_tick() const { return 2.0 * std::numbers::pi / p_.encoder.counts_per_revolution / h; }
  void note(const Plant& plant) {
    rotor_ = static_cast<double>(plant.position_counts()) + plant.position_fraction();
    load_ = plant.load_position_counts();
  }

  Parameters p_;
  double rotor_ = 0.0;
  double load_ = 0.0;
  double sum_j_ = 0.0;
};

// The energy from the supply between two times equals the heat, the friction and the stored energy. At least `least_j`
// flows through the motor.
inline void expect_energy_balance(const Energy& start, const Energy& end, const Dissipation& friction, double least_j) {
  const auto stored_j = [](const Energy& e) { return e.kinetic_j + e.elastic_j + e.weight_j + e.cogging_j; };
  const auto during = [&](double Energy::*which) { return end.*which - start.*which; };
  const double to_motor_j = during(&Energy::to_motor_j);
  const double electric =
      to_motor_j - during(&Energy::copper_j) - during(&Energy::shaft_j) - during(&Energy::magnetic_j);
  const double mechanic = during(&Energy::shaft_j) - friction.sum_j() - during(&Energy::iron_j) -
                          during(&Energy::brake_j) - during(&Energy::stop_j) - (stored_j(end) - stored_j(start));
  const double link = during(&Energy::supplied_j) - during(&Energy::chopped_j) - during(&Energy::standby_j) -
                      during(&Energy::stage_j) - to_motor_j - during(&Energy::link_stored_j);
  EXPECT_GT(to_motor_j, least_j);
  EXPECT_NEAR(electric, 0.0, 1.0e-3 * to_motor_j);
  EXPECT_NEAR(mechanic, 0.0, 1.0e-4 * to_motor_j);
  EXPECT_NEAR(link, 0.0, 1.0e-5 * to_motor_j);
}

// The same for three seconds. `step` makes one tick, with the angle of the command (0.8 Hz).
template <typename Step>
void expect_energy_balance(const Parameters& parameters, double least_j, const Step& step) {
  Rig rig(parameters);
  const Energy start = rig.plant.energy();
  Dissipation friction(rig.plant);
  for (int tick = 0; tick < 48000; ++tick) {
    step(rig, tick, 2.0 * std::numbers::pi * 0.8 * tick * h);
    friction.add(rig.plant);
  }
  expect_energy_balance(start, rig.plant.energy(), friction, least_j);
}

}  // namespace servodrome::plant::test
