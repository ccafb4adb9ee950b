#include <gtest/gtest.h>

#include "plant/rig.hpp"

// The rigid shaft: friction, gravity, stops, brake, clamp.
namespace servodrome::plant::test {
namespace shaft_test {
namespace {

double position_rad(const Plant& plant) {
  return (static_cast<double>(plant.position_counts()) + plant.position_fraction()) * 2.0 * std::numbers::pi /
         plant.parameters().encoder.counts_per_revolution;
}

// Without a motor: the coupling to the windings is tested elsewhere.
TEST(Shaft, CoastsDownExponentially) {
  for (const double viscous : {1.0e-5, 1.0e-3, 0.5, 1000.0}) {  // time constants from 5.6 s to 56 ns
    Parameters p = bare_motor();
    p.load.viscous_friction_nms = viscous;
    p.load.inertia_kgm2 = 0.28e-4;
    Rig rig(p);
    rig.spin_up(1000.0);
    const double speed = rig.speed_rad_s();
    const double start = position_rad(rig.plant);
    const double tau = 0.56e-4 / viscous;
    for (int tick = 1; tick < 3200; ++tick) {
      rig.step();
      ASSERT_NEAR(rig.speed_rad_s(), speed * std::exp(-tick * h / tau), 1.0e-9 * speed);
      ASSERT_NEAR(position_rad(rig.plant) - start, speed * tau * (1.0 - std::exp(-tick * h / tau)), 1.0e-7);
    }
  }
}

TEST(Shaft, DryFrictionStopsItInTimeAndForGood) {
  Parameters p = bare_motor();
  p.load.coulomb_friction_nm = 0.01;
  p.load.static_friction_nm = 0.015;
  p.load.inertia_kgm2 = 0.28e-4;
  Rig rig(p);
  rig.spin_up(1000.0);
  const double start = position_rad(rig.plant);
  const double speed = rig.speed_rad_s();
  const double deceleration = 0.01 / 0.56e-4;
  int ticks = 0;
  while (rig.plant.velocity_rpm() != 0.0 && ++ticks < 100000) rig.step();
  EXPECT_NEAR(ticks * h, speed / deceleration, 1.5 * h);
  EXPECT_NEAR(position_rad(rig.plant) - start, 0.5 * speed * speed / deceleration, 1.0e-3);
  const std::int64_t counts = rig.plant.position_counts();
  const double fraction = rig.plant.position_fraction();
  rig.run(100000);
  EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
  EXPECT_EQ(rig.plant.position_counts(), counts);
  EXPECT_EQ(rig.plant.position_fraction(), fraction);
}

TEST(Shaft, BreakawayNeedsMoreThanSliding) {
  Parameters p = bare_motor();
  p.load.coulomb_friction_nm = 0.1;
  p.load.static_friction_nm = 0.15;
  Rig rig(p);
  for (const double torque : {0.149, -0.149, 0.15}) {
    rig.plant.set_external_torque_nm(torque);
    rig.run(1000);
    EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
    EXPECT_EQ(rig.plant.position_counts(), 0);
  }
  rig.plant.set_external_torque_nm(-0.151);
  rig.run(160);
  EXPECT_NEAR(rig.speed_rad_s(), (0.151 - 0.1) / 0.28e-4 * 0.01, 1e-9);
  rig.plant.set_external_torque_nm(-0.12);  // once it moves, 0.12 Nm keeps it moving
  rig.run(160);
  EXPECT_NEAR(rig.speed_rad_s(), (0.051 + 0.02) / 0.28e-4 * 0.01, 1e-9);
}

// A shaft at rest needs no computing time per tick; anything that moves it ends this state.
TEST(Shaft, WakesFromALongRest) {
  Parameters p = bare_motor();
  p.load.coulomb_friction_nm = 0.1;
  p.load.static_friction_nm = 0.15;
  p.motor.brake_torque_nm = 2.0;
  const auto rested = [&p](double held_nm, bool brake) {
    Rig rig(p);
    rig.actuation.brake_released = !brake;
    rig.plant.set_external_torque_nm(held_nm);
    rig.run(4000);
    EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
    return rig;
  };
  Rig pushed = rested(0.0, false);
  pushed.plant.set_external_torque_nm(0.2);
  Rig released = rested(0.2, true);
  released.actuation.brake_released = true;
  Rig unlocked = rested(0.1, false);
  unlocked.plant.lock_rotor(true);
  unlocked.plant.set_external_torque_nm(0.2);
  unlocked.run(4000);
  EXPECT_EQ(unlocked.plant.velocity_rpm(), 0.0);
  unlocked.plant.lock_rotor(false);
  Rig slippery = rested(0.1, false);
  slippery.plant.set_coulomb_friction_nm(0.0);
  for (Rig* rig : {&pushed, &released, &unlocked, &slippery}) {
    rig->run(1600);
    EXPECT_LT(rig->plant.velocity_rpm(), -100.0);
  }
  Rig driven = rested(0.0, false);
  for (int tick = 0; tick < 1600; ++tick) driven.step_voltage(0.0, 20.0);
  EXPECT_GT(driven.plant.velocity_rpm(), 100.0);

  Rig wired = rested(0.0, false);
  wired.plant.force_input(3, true);
  wired.step();
  EXPECT_EQ(wired.feedback.edge_count, 1);
  EXPECT_EQ(wired.feedback.inputs & 8u, 8u);
  wired.plant.set_supply_v(350.0);
  wired.plant.inject(Injection::winding_overheat, true);
  wired.run(80000);
  EXPECT_EQ(wired.feedback.edge_count, 0);
  EXPECT_NEAR(static_cast<double>(wired.feedback.dc_link_v), 350.0, 1.0);
  EXPECT_EQ(wired.feedback.winding_temperature_c, 180.0F);
}

TEST(Shaft, GravityIsHeldByStictionAndPullsTowardsSmallerCounts) {
  Parameters p = bare_motor();
  p.load.gravity_torque_nm = 0.2;
  p.load.coulomb_friction_nm = 0.15;
  p.load.static_friction_nm = 0.2;
  Rig rig(p);
  rig.run(50000);
  EXPECT_EQ(rig.plant.position_counts(), 0);
  EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
  rig.plant.set_external_torque_nm(0.001);
  rig.run(1600);
  EXPECT_NEAR(rig.speed_rad_s(), -(0.201 - 0.15) / 0.28e-4 * 0.1, 1e-6);
  EXPECT_LT(rig.plant.position_counts(), -100);
}

TEST(Shaft, HardStopsHoldAtEveryStiffness) {
  for (const double stiffness : {1.0, 1.0e3, 1.0e5, 1.0e9}) {
    for (const double damping : {0.0, 1.0, 1.0e5}) {
      for (const int side : {1, -1}) {
        Parameters p = bare_motor();
        p.load.inertia_kgm2 = 1.0e-4;
        p.load.low_stop_counts = -100000;
        p.load.high_stop_counts = 100000;
        p.load.stop_stiffness_nm_per_rad = stiffness;
        p.load.stop_damping_nms = damping;
        p.load.external_torque_nm = -side * 0.5;
        Rig rig(p);
        const double stop = side * 100000 * 2.0 * std::numbers::pi / 131072;
        const double inertia = 1.28e-4;
        double beyond = -1.0;
        double speed = 0.0;
        double rebound = 0.0;
        for (int tick = 0; tick < 48000; ++tick) {
          const double energy = rig.plant.energy().kinetic_j + rig.plant.energy().elastic_j;
          const double before = position_rad(rig.plant);
          rig.step();
          const double work = 0.5 * side * (position_rad(rig.plant) - before);
          const Energy after = rig.plant.energy();
          ASSERT_LE(after.kinetic_j + after.elastic_j, energy * (1.0 + 1.0e-10) + work + 1.0e-12);
          beyond = std::max(beyond, side * (position_rad(rig.plant) - stop));
          if (beyond <= 0.0) speed = std::max(speed, side * rig.speed_rad_s());
          rebound = std::max(rebound, -side * rig.speed_rad_s());
        }
        // The depth in the stop must not exceed what the energy allows, and the rebound speed must not exceed the speed
        // of approach (which was a little higher between two ticks). The shaft rests where spring and torque balance,
        // unless the damping is so strong that this takes hours, or so weak that it rebounds for long.
        const double sag = 0.5 / stiffness;
        EXPECT_LE(beyond, sag + std::sqrt(sag * sag + inertia / stiffness * speed * speed) + speed * h);
        EXPECT_LE(rebound, std::sqrt(speed * speed + 0.5 * sag / inertia) + 0.5 / inertia * h);
        const bool fades = damping > 0.05 * 2.0 * std::sqrt(stiffness * inertia);  // within few rebounds
        if (fades && damping < 0.01 * stiffness) {
          EXPECT_NEAR(rig.speed_rad_s(), 0.0, 1e-3);
          EXPECT_NEAR(side * (position_rad(rig.plant) - stop), sag, 1.0e-6);
        }
      }
    }
  }
}

// A linear spring with a damper that never pulls: the rebound speed, as a share of the speed of approach, by the
// damping ratio.
double restitution(double ratio) {
  const double share = std::sqrt(1.0 - ratio * ratio);
  const double angle = std::numbers::pi - std::atan2(2.0 * ratio * share, 1.0 - 2.0 * ratio * ratio);
  return -std::exp(-ratio / share * angle) * (std::cos(angle) - ratio / share * std::sin(angle));
}

// At any time within a tick, and for any number of ticks of contact.
TEST(Shaft, HardStopsReboundAsTheirStiffnessAndDampingSay) {
  for (const double contact_ticks : {0.05, 0.3, 1.0, 5.0, 20.0}) {
    for (const double ratio : {0.0, 0.03, 0.13, 0.4}) {
      for (const int side : {1, -1}) {
        for (const std::int64_t stop : {100, 137, 158, 231}) {
          Parameters p = bare_motor();
          p.motor.torque_constant_nm_per_a = 1.0e-4;  // no current brakes it
          p.load.inertia_kgm2 = 1.0e-4;
          const double inertia = 1.28e-4;
          const double natural = std::numbers::pi / (contact_ticks * h);
          p.load.stop_stiffness_nm_per_rad = inertia * natural * natural;
          p.load.stop_damping_nms = 2.0 * ratio * inertia * natural;
          (side > 0 ? p.load.high_stop_counts : p.load.low_stop_counts) = side * stop;
          Rig rig(p);
          rig.spin_up(side * 300.0);
          const double came = rig.speed_rad_s();
          const double energy = rig.plant.energy().kinetic_j;
          rig.run(static_cast<int>(2.0 * contact_ticks) + 8);
          SCOPED_TRACE(testing::Message() << contact_ticks << " ticks, ratio " << ratio << ", stop " << side * stop);
          const double expected = restitution(ratio);
          EXPECT_NEAR(-rig.speed_rad_s() / came, expected, 0.02 * expected);
          EXPECT_NEAR((came - rig.speed_rad_s()) / came, 1.0 + expected, 0.01 * (1.0 + expected));  // the impulse
          const Energy after = rig.plant.energy();
          EXPECT_NEAR(after.kinetic_j + after.stop_j, energy, 1.0e-5 * energy);
        }
      }
    }
  }
}

TEST(Shaft, BrakeHoldsAndTakesItsTime) {
  Parameters p = bare_motor();
  p.motor.brake_torque_nm = 2.0;
  p.motor.brake_release_ms = 30.0;
  p.motor.brake_engage_ms = 20.0;
  p.load.gravity_torque_nm = 1.5;
  Rig rig(p);
  rig.actuation.brake_released = false;
  rig.run(16000);
  EXPECT_TRUE(rig.plant.brake_engaged());
  EXPECT_EQ(rig.plant.position_counts(), 0);
  rig.actuation.brake_released = true;
  rig.run(480);
  EXPECT_TRUE(rig.plant.brake_engaged());
  EXPECT_EQ(rig.plant.position_counts(), 0);
  rig.run(1);
  EXPECT_FALSE(rig.plant.brake_engaged());
  EXPECT_LT(rig.plant.velocity_rpm(), 0.0);
  rig.actuation.brake_released = false;
  rig.run(320);
  EXPECT_FALSE(rig.plant.brake_engaged());
  rig.run(1);
  EXPECT_TRUE(rig.plant.brake_engaged());
  rig.run(16000);
  EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
  // A command that is withdrawn before its time does not change the brake.
  const std::int64_t held = rig.plant.position_counts();
  for (int i = 0; i < 10; ++i) {
    rig.actuation.brake_released = true;
    rig.run(400);
    rig.actuation.brake_released = false;
    rig.run(10);
  }
  EXPECT_EQ(rig.plant.position_counts(), held);
  rig.plant.inject(Injection::brake_stuck, true);
  rig.actuation.brake_released = true;
  rig.run(16000);
  EXPECT_EQ(rig.plant.position_counts(), held);
  rig.plant.inject(Injection::brake_stuck, false);
  rig.run(16);
  EXPECT_NE(rig.plant.position_counts(), held);
}

TEST(Shaft, LockedRotorStandsWhateverPulls) {
  Parameters p = bare_motor();
  Rig rig(p);
  rig.spin_up(500.0);
  rig.plant.lock_rotor(true);
  EXPECT_TRUE(rig.plant.rotor_locked());
  rig.step();
  const std::int64_t counts = rig.plant.position_counts();
  rig.plant.set_external_torque_nm(1.0e5);
  rig.run(1000);
  EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
  EXPECT_EQ(rig.plant.position_counts(), counts);
  rig.plant.set_external_torque_nm(-0.1);
  rig.plant.lock_rotor(false);
  rig.run(160);
  EXPECT_NEAR(rig.speed_rad_s(), 0.1 / 0.28e-4 * 0.01, 1e-9);
}

// Small oscillation in a cogging detent: w = sqrt(amplitude * periods / J).
TEST(Shaft, CoggingDetentsHaveTheirFrequency) {
  Parameters p = bare_motor();
  p.motor.cogging_torque_nm = 0.05;
  p.motor.cogging_periods_per_revolution = 30;
  p.motor.torque_constant_nm_per_a = 1.0e-4;
  Rig rig(p);
  rig.plant.set_position_counts(200);  // of 4369 in a period
  const double frequency = std::sqrt(0.05 * 30 / 0.28e-4);
  int crossings = 0;
  std::int64_t lowest = 0;
  std::int64_t highest = 0;
  bool above = true;
  for (int tick = 0; tick < 160000; ++tick) {
    rig.step();
    const std::int64_t position = rig.plant.position_counts();
    if (above != (position >= 0)) {
      above = !above;
      ++crossings;
    }
    if (tick > 150000) {
      lowest = std::min(lowest, position);
      highest = std::max(highest, position);
    }
  }
  // The amplitude of 0.29 rad of a period lowers a pendulum's frequency by a^2/16.
  const double expected = 2.0 * 10.0 * frequency / (2.0 * std::numbers::pi) * (1.0 - 0.2876 * 0.2876 / 16.0);
  EXPECT_NEAR(crossings, expected, 0.002 * expected);
  EXPECT_NEAR(static_cast<double>(highest), 200.0, 3.0);  // the oscillation neither grows nor decays in 10 s
  EXPECT_NEAR(static_cast<double>(lowest), -200.0, 3.0);
}

}  // namespace
}  // namespace shaft_test
}  // namespace servodrome::plant::test
