#include <gtest/gtest.h>

#include "plant/rig.hpp"

// Loads that depend on position or speed: arm, crank, belt, Stribeck friction; torque build-up and wear of the brake;
// iron losses.
namespace servodrome::plant::test {
namespace load_test {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

// A motor without current, so that only the mechanics act.
Parameters mechanics() {
  Parameters p = bare_motor();
  p.motor.torque_constant_nm_per_a = 1.0e-4;
  return p;
}

double turns(const Plant& plant) {
  return (static_cast<double>(plant.position_counts()) + plant.position_fraction()) /
         plant.parameters().encoder.counts_per_revolution;
}

double mechanical_j(const Plant& plant) {
  const Energy e = plant.energy();
  return e.kinetic_j + e.elastic_j + e.weight_j + e.cogging_j;
}

// The period: the time between the first and the last upward crossing of `centre_turns`, divided by the number of
// periods.
double period_s(Rig& rig, double centre_turns, int ticks) {
  double first = -1.0;
  double last = -1.0;
  int periods = -1;
  double before = turns(rig.plant) - centre_turns;
  for (int tick = 0; tick < ticks; ++tick) {
    rig.step();
    const double now = turns(rig.plant) - centre_turns;
    if (before < 0.0 && now >= 0.0) {
      last = (tick + before / (before - now)) * h;
      if (first < 0.0) first = last;
      ++periods;
    }
    before = now;
  }
  return (last - first) / periods;
}

// An arm behind a gear of 10 hangs at three quarters of its turn, and oscillates around that position like a pendulum:
// period 2 pi sqrt(J / (torque / ratio)) (1 + a^2 / 16), with the amplitude a in rad of the arm.
TEST(Load, AnArmSwingsAsAPendulum) {
  Parameters p = mechanics();
  p.load.inertia_kgm2 = 1.0e-4;
  p.load.cycle_revolutions = 10.0;
  p.load.arm_torque_nm = 0.5;
  const double amplitude_turns = 0.02;  // of the arm
  Rig rig(p);
  rig.plant.set_position_counts(std::llround((0.75 - amplitude_turns) * 10.0 * 131072));
  const double energy = mechanical_j(rig.plant);
  const double amplitude = two_pi * amplitude_turns;
  const double expected = two_pi * std::sqrt(1.28e-4 * 10.0 / 0.5) * (1.0 + amplitude * amplitude / 16.0);
  EXPECT_NEAR(period_s(rig, 7.5, 160'000), expected, 1.0e-4 * expected);
  EXPECT_NEAR(mechanical_j(rig.plant), energy, 1.0e-3 * (0.5 * 10.0 + energy));  // -5 J is the lowest position
}

TEST(Load, TheWeightOfAnArmIsGreatestAtItsHorizontalPlace) {
  for (const double place : {0.0, 0.1, 0.25, 0.4, 0.5, 0.8}) {  // turns of the arm
    Parameters p = mechanics();
    p.load.cycle_revolutions = 4.0;
    p.load.cycle_offset_turns = 0.125;
    p.load.arm_torque_nm = 0.3;
    p.encoder.start_position_counts = std::llround((place - 0.125) * 4.0 * 131072);
    Rig rig(p);
    rig.run(1);
    EXPECT_NEAR(rig.speed_rad_s(), -0.3 * std::cos(two_pi * place) / 0.28e-4 * h, 1.0e-5) << place;
  }
}

// Static friction holds an arm where the torque of its weight is smaller, and lets it fall where it is greater. The
// brake holds it everywhere.
TEST(Load, FrictionAndBrakeHoldAnArm) {
  Parameters p = mechanics();
  p.load.inertia_kgm2 = 1.0e-3;
  p.load.arm_torque_nm = 0.3;
  p.load.coulomb_friction_nm = 0.1;
  p.load.static_friction_nm = 0.15;  // cos 60 degrees = 0.5
  for (const auto& [place, holds] : {std::pair{0.17, true}, std::pair{0.16, false}, std::pair{0.33, true},
                                     std::pair{0.34, false}, std::pair{0.75, true}}) {
    p.encoder.start_position_counts = std::llround(place * 131072);
    Rig rig(p);
    rig.run(1600);
    EXPECT_EQ(rig.plant.position_counts() == p.encoder.start_position_counts, holds) << place;
    EXPECT_EQ(rig.plant.velocity_rpm() == 0.0, holds) << place;
  }
  p.motor.brake_torque_nm = 1.0;
  p.encoder.start_position_counts = 0;
  Rig rig(p);
  rig.actuation.brake_released = false;
  rig.run(16000);
  EXPECT_EQ(rig.plant.position_counts(), 0);
  rig.actuation.brake_released = true;
  rig.run(1600);
  EXPECT_LT(rig.plant.velocity_rpm(), 0.0);
  rig.actuation.brake_released = false;
  rig.run(8000);
  EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
  const std::int64_t held = rig.plant.position_counts();
  rig.run(16000);
  EXPECT_EQ(rig.plant.position_counts(), held);
}

// A slider on a crank: without weight and friction the kinetic energy is constant, so the speed falls with the square
// root of the inertia.
TEST(Load, ACrankTurnsAsItsInertiaAllows) {
  for (const bool elastic : {false, true}) {
    Parameters p = mechanics();
    p.load.inertia_kgm2 = 1.0e-4;
    p.load.crank_inertia_kgm2 = 4.0e-4;
    p.load.crank_ratio = 0.3;
    p.load.elastic = elastic;
    p.load.stiffness_nm_per_rad = 2000.0;
    p.load.damping_nms = 0.0;
    Rig rig(p);
    rig.spin_up(600.0);
    const double energy = mechanical_j(rig.plant);
    double least = 1.0e9;
    double most = 0.0;
    for (int tick = 0; tick < 32000; ++tick) {
      rig.step();
      const double angle = two_pi * turns(rig.plant);
      const double slide = std::sin(angle) + 0.15 * std::sin(2.0 * angle);
      const double inertia = 1.28e-4 + 4.0e-4 * slide * slide;
      least = std::min(least, rig.speed_rad_s());
      most = std::max(most, rig.speed_rad_s());
      if (elastic) continue;
      ASSERT_NEAR(rig.speed_rad_s(), std::sqrt(2.0 * energy / inertia), 1.0e-6 * rig.speed_rad_s());
    }
    EXPECT_NEAR(mechanical_j(rig.plant), energy, (elastic ? 1.0e-3 : 1.0e-9) * energy);
    EXPECT_GT(most, 1.8 * least);
  }
}

// The slider of a vertical crank falls to its lowest position, 0, and oscillates around it.
TEST(Load, TheWeightOfASliderPullsItDown) {
  Parameters p = mechanics();
  p.load.inertia_kgm2 = 1.0e-4;
  p.load.crank_torque_nm = 0.2;
  p.load.crank_ratio = 0.25;
  p.encoder.start_position_counts = -1000;
  Rig rig(p);
  const double amplitude = two_pi * 1000.0 / 131072;
  const double expected = two_pi * std::sqrt(1.28e-4 / (0.2 * 1.25)) * (1.0 + amplitude * amplitude / 8.0);
  EXPECT_NEAR(period_s(rig, 0.0, 160'000), expected, 1.0e-3 * expected);
}

// Stribeck: from the static friction at standstill down to the sliding friction, with exp(-(w / scale)^2).
TEST(Load, StribeckFrictionFallsWithTheSpeed) {
  Parameters p = mechanics();
  p.load.inertia_kgm2 = 1.0e-3;
  p.load.coulomb_friction_nm = 0.05;
  p.load.static_friction_nm = 0.15;
  p.load.stribeck_speed_rad_s = 2.0;
  Rig rig(p);
  rig.plant.set_external_torque_nm(-0.1499);
  rig.run(1600);
  EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
  rig.plant.set_external_torque_nm(-0.151);
  double speed = 0.0;
  double worst = 0.0;
  for (int tick = 0; tick < 16000 && speed < 20.0; ++tick) {
    rig.step();
    const double mean = 0.5 * (speed + rig.speed_rad_s());
    const double ratio = mean / 2.0;
    const double expected = (0.151 - 0.05 - 0.1 * std::exp(-ratio * ratio)) / 1.028e-3 * h;
    worst = std::max(worst, std::abs(rig.speed_rad_s() - speed - expected));
    speed = rig.speed_rad_s();
  }
  EXPECT_GT(speed, 19.0);
  EXPECT_LT(worst, 0.003 * 0.1 / 1.028e-3 * h);  // 0.3 % of the change of friction
}

// The harmonics add up, each with its own phase.
TEST(Load, CoggingIsTheSumOfItsHarmonics) {
  Parameters p = mechanics();
  p.motor.rotor_inertia_kgm2 = 1.0e-4;
  p.motor.cogging_torque_nm = 0.02;
  p.motor.cogging_periods_per_revolution = 30;
  p.motor.cogging[0] = {.torque_nm = 0.01, .periods = 60, .phase_turns = 0.1};
  p.motor.cogging[1] = {.torque_nm = 0.005, .periods = 10, .phase_turns = 0.7};
  p.motor.cogging_count = 2;
  for (const int counts : {0, 1000, 20000, 70000, 131000}) {
    p.encoder.start_position_counts = counts;
    Rig rig(p);
    rig.run(1);
    const double turn = counts / 131072.0;
    const double expected = -0.02 * std::sin(two_pi * 30.0 * turn) - 0.01 * std::sin(two_pi * (60.0 * turn + 0.1)) -
                            0.005 * std::sin(two_pi * (10.0 * turn + 0.7));
    EXPECT_NEAR(rig.speed_rad_s(), expected / 1.0e-4 * h, 1.0e-5) << counts;
  }
  Rig rig(p);
  rig.spin_up(150.0);
  const double energy = mechanical_j(rig.plant);
  for (int tick = 0; tick < 32000; ++tick) {
    rig.step();
    ASSERT_NEAR(mechanical_j(rig.plant), energy, 0.001 * energy);
  }
}

// The carriage of a belt axis vibrates against the held rotor with sqrt(k / J), and k = middle / (1 - (2 x /
// length)^2).
TEST(Load, ABeltIsStifferNearItsEnds) {
  for (const double place : {0.0, 2.0, -3.0}) {  // motor revolutions from the middle
    Parameters p = mechanics();
    p.load.elastic = true;
    p.load.inertia_kgm2 = 5.0e-4;
    p.load.stiffness_nm_per_rad = 20.0;
    p.load.damping_nms = 0.0;
    p.load.belt_length_revolutions = 8.0;
    p.load.belt_middle_revolutions = 5.0;
    p.encoder.start_position_counts = std::llround((5.0 + place) * 131072);
    Rig rig(p);
    rig.plant.lock_rotor(true);
    rig.plant.set_external_torque_nm(-0.5);
    rig.run(16);
    rig.plant.set_external_torque_nm(0.0);
    int crossings = 0;
    int last = 0;
    int first = -1;
    for (int tick = 0; tick < 16000; ++tick) {
      const double before = rig.plant.load_velocity_rpm();
      rig.step();
      if (before >= 0.0 || rig.plant.load_velocity_rpm() < 0.0) continue;
      if (first < 0) first = tick;
      last = tick;
      ++crossings;
    }
    const double found = two_pi * (crossings - 1) / ((last - first) * h);
    const double share = place / 4.0;
    const double expected = std::sqrt(20.0 / (1.0 - share * share) / 5.0e-4);
    EXPECT_NEAR(found, expected, 2.0e-3 * expected) << place;
  }
}

TEST(Load, ABeltKeepsItsEnergyAlongTheTravel) {
  Parameters p = mechanics();
  p.load.elastic = true;
  p.load.inertia_kgm2 = 5.0e-4;
  p.load.stiffness_nm_per_rad = 20.0;
  p.load.damping_nms = 0.0;
  p.load.belt_length_revolutions = 3.0;
  Rig rig(p);
  rig.spin_up(60.0);  // the rotor is ahead of the load
  const double energy = mechanical_j(rig.plant);
  for (int tick = 0; tick < 24000; ++tick) {
    rig.step();
    ASSERT_NEAR(mechanical_j(rig.plant), energy, 0.005 * energy) << tick;
  }
  EXPECT_GT(turns(rig.plant), 0.7);
}

// The torque rises during the last 10 of 20 ms. During this time the brake has a part of its torque, and a load that is
// too heavy for it falls.
TEST(Load, TheBrakeBuildsItsTorqueUp) {
  Parameters p = mechanics();
  p.motor.brake_torque_nm = 2.0;
  p.motor.brake_release_ms = 10.0;
  p.motor.brake_engage_ms = 20.0;
  p.motor.brake_rise_ms = 10.0;
  p.load.inertia_kgm2 = 1.0e-2;
  Rig rig(p);
  rig.run(200);
  rig.spin_up(600.0);
  rig.actuation.brake_released = false;
  const double inertia = 1.0028e-2;
  double speed = rig.speed_rad_s();
  for (int tick = 1; tick <= 400; ++tick) {
    rig.step();
    const double braked_nm = (speed - rig.speed_rad_s()) * inertia / h;
    const double expected = tick <= 160 ? 0.0 : std::min(2.0, 2.0 * (tick - 160) / 161.0);
    ASSERT_NEAR(braked_nm, expected, 1.0e-6) << tick;
    EXPECT_EQ(rig.plant.brake_engaged(), tick > 320);
    speed = rig.speed_rad_s();
  }
  // If the brake is released while its torque rises, it keeps the present part of the torque until the release is
  // complete.
  rig.actuation.brake_released = true;
  rig.run(161);
  rig.actuation.brake_released = false;
  rig.run(240);
  rig.actuation.brake_released = true;
  for (int tick = 1; tick <= 160; ++tick) {
    speed = rig.speed_rad_s();
    rig.step();
    ASSERT_NEAR((speed - rig.speed_rad_s()) * inertia / h, 2.0 * 80.0 / 161.0, 1.0e-6);
  }
  speed = rig.speed_rad_s();
  rig.run(10);
  EXPECT_EQ(rig.speed_rad_s(), speed);
}

// The work of the brake is the energy that it absorbs, and each `brake_half_torque_j` of it halves the torque.
TEST(Load, TheBrakeWears) {
  Parameters p = mechanics();
  p.motor.brake_torque_nm = 2.0;
  p.motor.brake_release_ms = 1.0;
  p.motor.brake_engage_ms = 1.0;
  p.motor.brake_half_torque_j = 200.0;
  p.load.inertia_kgm2 = 1.0e-2;
  Rig rig(p);
  double taken_j = 0.0;
  for (int stop = 0; stop < 5; ++stop) {
    rig.actuation.brake_released = true;
    rig.run(100);
    rig.spin_up(1200.0);
    taken_j += rig.plant.energy().kinetic_j;
    rig.actuation.brake_released = false;
    int ticks = 0;
    while (rig.plant.velocity_rpm() != 0.0 && ticks < 160'000) {
      rig.step();
      ++ticks;
    }
    EXPECT_NEAR(rig.plant.energy().brake_j, taken_j, 1.0e-3 * taken_j);
  }
  const double left_nm = 2.0 * std::exp2(-taken_j / 200.0);
  for (const double share : {0.99, 1.01}) {
    const std::int64_t held = rig.plant.position_counts();
    rig.plant.set_external_torque_nm(-share * left_nm);
    rig.run(1600);
    EXPECT_EQ(rig.plant.position_counts() == held, share < 1.0);
  }
}

// Hysteresis is a constant drag, eddy currents a drag in proportion to the speed; both heat the case.
TEST(Load, IronLossBrakesAndHeatsTheCase) {
  Parameters p = mechanics();
  p.motor.iron_hysteresis_nm = 0.02;
  p.motor.iron_eddy_nms = 1.0e-4;
  p.load.inertia_kgm2 = 1.0e-2;
  Rig rig(p);
  rig.spin_up(3000.0);
  const double speed = rig.speed_rad_s();
  const double start = rig.plant.energy().kinetic_j;
  rig.run(16000);
  const double inertia = 1.0028e-2;
  const double rest = 0.02 / 1.0e-4;  // J dw/dt = -eddy (w + rest)
  const double expected = (speed + rest) * std::exp(-1.0e-4 / inertia) - rest;
  EXPECT_NEAR(rig.speed_rad_s(), expected, 1.0e-5 * expected);
  const Energy end = rig.plant.energy();
  EXPECT_NEAR(end.iron_j, start - end.kinetic_j, 1.0e-6 * start);
  const double rise_k = end.iron_j / p.thermal.case_heat_capacity_j_per_k;
  EXPECT_NEAR(rig.plant.case_temperature_c() - 25.0, rise_k, 0.03 * rise_k);
}

// The bench changes the load of an arm while it moves: the weight still acts by the arm's position.
TEST(Load, TheBenchChangesALoadOnAnArm) {
  Parameters p = mechanics();
  p.load.arm_torque_nm = 0.3;
  p.load.crank_inertia_kgm2 = 1.0e-4;
  Rig rig(p);
  rig.plant.set_position_counts(131072 / 3);
  rig.plant.set_external_torque_nm(0.1);
  rig.plant.set_load_inertia_kgm2(2.0e-4);
  const double angle = two_pi * (131072 / 3) / 131072.0;
  const double inertia = 2.28e-4 + 1.0e-4 * std::sin(angle) * std::sin(angle);
  rig.run(1);
  EXPECT_NEAR(rig.speed_rad_s(), -(0.1 + 0.3 * std::cos(angle)) / inertia * h, 1.0e-6);
}

}  // namespace
}  // namespace load_test
}  // namespace servodrome::plant::test
