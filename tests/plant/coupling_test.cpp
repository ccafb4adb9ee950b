#include <gtest/gtest.h>

#include "plant/rig.hpp"

// The elastic coupling.
namespace servodrome::plant::test {
namespace coupling_test {
namespace {

Parameters two_masses() {
  Parameters p = bare_motor();
  p.load.elastic = true;
  p.load.inertia_kgm2 = 1.0e-4;
  p.load.stiffness_nm_per_rad = 100.0;
  p.load.damping_nms = 0.0;
  p.load.external_torque_nm = 0.0;
  return p;
}

// Frequency of a free oscillation of the twist, from its zero crossings.
double vibration_hz(Rig& rig, int ticks) {
  double first = 0.0;
  double last = 0.0;
  int crossings = 0;
  double old = rig.plant.coupling_twist_rad();
  for (int tick = 0; tick < ticks; ++tick) {
    rig.step();
    const double twist = rig.plant.coupling_twist_rad();
    if (old < 0.0 && twist >= 0.0) {
      last = (tick + old / (old - twist)) * h;
      if (crossings++ == 0) first = last;
    }
    old = twist;
  }
  return (crossings - 1) / (last - first);
}

void kick(Rig& rig) {
  rig.plant.set_external_torque_nm(-1.0);
  rig.run(4);
  rig.plant.set_external_torque_nm(0.0);
}

TEST(Coupling, ResonanceWithBothMassesFree) {
  for (const double stiffness : {10.0, 100.0, 400.0}) {  // 107, 340, 680 Hz
    Parameters p = two_masses();
    p.load.stiffness_nm_per_rad = stiffness;
    Rig rig(p);
    kick(rig);
    const double reduced = 0.28e-4 * 1.0e-4 / 1.28e-4;
    const double exact = std::sqrt(stiffness / reduced) / (2.0 * std::numbers::pi);
    EXPECT_NEAR(vibration_hz(rig, 16000), exact, 0.01 * exact);
  }
}

TEST(Coupling, AntiresonanceWithTheRotorHeld) {
  Parameters p = two_masses();
  Rig rig(p);
  rig.plant.lock_rotor(true);
  kick(rig);
  const double exact = std::sqrt(100.0 / 1.0e-4) / (2.0 * std::numbers::pi);
  EXPECT_NEAR(vibration_hz(rig, 16000), exact, 0.01 * exact);
  EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
}

TEST(Coupling, DampingRatio) {
  Parameters p = two_masses();
  p.load.damping_nms = 0.004;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  kick(rig);
  double first = 0.0;
  double second = 0.0;
  for (int tick = 0; tick < 800; ++tick) {
    rig.step();
    (tick < 400 ? first : second) = std::max(tick < 400 ? first : second, std::abs(rig.plant.coupling_twist_rad()));
  }
  // exp(-d / (2 J) t) over 25 ms
  EXPECT_NEAR(second / first, std::exp(-0.004 / 2.0e-4 * 0.025), 0.02);
}

TEST(Coupling, UndampedEnergyStaysForever) {
  Rig rig(two_masses());
  kick(rig);
  const Energy before = rig.plant.energy();
  rig.run(160000);
  const Energy after = rig.plant.energy();
  EXPECT_NEAR(after.kinetic_j + after.elastic_j, before.kinetic_j + before.elastic_j,
              1.0e-9 * (before.kinetic_j + before.elastic_j));
}

TEST(Coupling, StaticTwistIsTorqueOverStiffness) {
  Parameters p = two_masses();
  p.load.damping_nms = 0.05;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  rig.plant.set_external_torque_nm(0.7);
  rig.run(16000);
  EXPECT_NEAR(rig.plant.coupling_twist_rad(), 0.7 / 100.0, 1e-9);
  EXPECT_NEAR(rig.plant.load_position_counts(), -0.007 * 131072 / (2.0 * std::numbers::pi), 1e-3);
}

// The load's own friction acts on the load: it holds up to its static torque with any torque of the spring, and has a
// lower torque when it slides.
TEST(Coupling, StaticFrictionOfTheLoadHoldsIt) {
  Parameters p = two_masses();
  p.load.damping_nms = 0.05;
  p.load.coulomb_friction_nm = 0.1;
  p.load.static_friction_nm = 0.15;
  Rig rig(p);
  for (const double torque : {0.149, -0.149}) {
    rig.plant.set_external_torque_nm(torque);
    rig.run(16000);
    EXPECT_EQ(rig.plant.position_counts(), 0) << torque;
    EXPECT_EQ(rig.plant.coupling_twist_rad(), 0.0) << torque;
  }
  rig.plant.set_external_torque_nm(-0.151);
  rig.run(16000);
  // Both masses accelerate with the torque that exceeds the sliding friction.
  EXPECT_NEAR(rig.speed_rad_s(), (0.151 - 0.1) / (p.motor.rotor_inertia_kgm2 + 1.0e-4), 0.01 * 51.0 / 0.128);
  rig.plant.set_external_torque_nm(-0.12);  // less than the breakaway torque, more than the sliding friction
  const double before = rig.speed_rad_s();
  rig.run(1600);
  EXPECT_GT(rig.speed_rad_s(), before);
}

TEST(Coupling, ViscosityOfTheLoadEndsItsSpeed) {
  Parameters p = two_masses();
  p.load.damping_nms = 0.05;
  for (const double viscous : {1.0e-3, 4.0e-3}) {
    p.load.viscous_friction_nms = viscous;
    Rig rig(p);
    rig.plant.set_external_torque_nm(-0.08);
    rig.run(16 * 3000);  // 3 s: many times (J1 + J2) / viscous
    EXPECT_NEAR(rig.speed_rad_s(), 0.08 / viscous, 1e-3 * 0.08 / viscous) << viscous;
    rig.plant.set_external_torque_nm(0.0);
    rig.run(16 * 3000);
    EXPECT_NEAR(rig.speed_rad_s(), 0.0, 1e-3);
  }
}

TEST(Coupling, BacklashLetsTheLoadSwingFreely) {
  Parameters p = two_masses();
  p.load.backlash_rad = 0.1;
  p.load.damping_nms = 0.05;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  // Free motion over half of the backlash: 0.05 rad at 1 Nm / 1e-4 kg m2.
  rig.plant.set_external_torque_nm(-0.01);
  int ticks = 0;
  while (rig.plant.coupling_twist_rad() > -0.05 && ++ticks < 16000) rig.step();
  EXPECT_NEAR(ticks * h, std::sqrt(2.0 * 0.05 / 100.0), 2.0 * h);
  rig.run(16000);
  EXPECT_NEAR(rig.plant.coupling_twist_rad(), -(0.05 + 0.01 / 100.0), 1e-6);
  rig.plant.set_external_torque_nm(0.01);
  rig.run(16000);
  EXPECT_NEAR(rig.plant.coupling_twist_rad(), 0.05 + 0.01 / 100.0, 1e-6);
}

TEST(Coupling, LoadStandsByItsOwnFrictionWhileTheRotorTurnsInThePlay) {
  Parameters p = two_masses();
  p.load.backlash_rad = 0.2;
  p.load.static_friction_nm = 0.05;
  p.load.coulomb_friction_nm = 0.05;
  Rig rig(p);
  for (int i = 0; i < 100; ++i) rig.step_voltage(0.0, 0.2);
  EXPECT_GT(rig.plant.velocity_rpm(), 1.0);
  EXPECT_EQ(rig.plant.load_velocity_rpm(), 0.0);
  EXPECT_NEAR(rig.plant.load_position_counts(), 0.0, 1e-6);
}

// Both turn together with the damper compressed; then the rotor is held. The load leaves the flank with its speed, and
// keeps it until it meets the other flank.
TEST(Coupling, TheDamperOfABacklashNeverPulls) {
  Parameters p = two_masses();
  p.load.backlash_rad = 0.2;
  p.load.damping_nms = 0.5;
  Rig rig(p);
  for (int i = 0; i < 400; ++i) rig.step_voltage(0.0, 1.4);
  ASSERT_NEAR(rig.plant.coupling_twist_rad(), 0.1, 0.01) << "the rotor pushes the load";
  const double speed = rig.plant.load_velocity_rpm() * rad_s_per_rpm;
  ASSERT_GT(speed, 5.0);
  rig.actuation.pwm_enabled = false;
  rig.plant.lock_rotor(true);
  int ticks = 0;
  while (rig.plant.coupling_twist_rad() > -0.09) {
    rig.step();
    ++ticks;
    ASSERT_NEAR(rig.plant.load_velocity_rpm() * rad_s_per_rpm, speed, 0.02 * speed) << ticks;
  }
  EXPECT_NEAR(ticks * h, 0.19 / speed, 0.1 * 0.19 / speed);
}

// The flanks make a light load rebound like a hard stop: by their stiffness and damping, at any time within a tick.
TEST(Coupling, FlanksRebound) {
  for (const double damping : {0.0, 0.02}) {
    Parameters p = two_masses();
    p.load.backlash_rad = 0.03;
    p.load.stiffness_nm_per_rad = 1.0e3;
    p.load.damping_nms = damping;
    Rig rig(p);
    rig.plant.lock_rotor(true);
    rig.plant.set_external_torque_nm(-20.0);
    rig.step();
    rig.plant.set_external_torque_nm(0.0);
    double speed = rig.plant.load_velocity_rpm() * rad_s_per_rpm;
    ASSERT_GT(speed, 10.0);
    const double ratio = damping / (2.0 * std::sqrt(1.0e3 * 1.0e-4));
    const double share = std::sqrt(1.0 - ratio * ratio);
    const double angle = std::numbers::pi - std::atan2(2.0 * ratio * share, 1.0 - 2.0 * ratio * ratio);
    const double expected = -std::exp(-ratio / share * angle) * (std::cos(angle) - ratio / share * std::sin(angle));
    for (int bounce = 0; bounce < 10; ++bounce) {
      const double came = speed;
      int ticks = 0;
      while (speed * came > 0.0 && ++ticks < 16000) {
        rig.step();
        speed = rig.plant.load_velocity_rpm() * rad_s_per_rpm;
      }
      rig.run(12);  // to the end of the contact
      speed = rig.plant.load_velocity_rpm() * rad_s_per_rpm;
      EXPECT_NEAR(-speed / came, expected, 0.01 * expected) << damping << " bounce " << bounce;
    }
  }
}

TEST(Coupling, StiffOneMovesAsIfRigid) {
  Parameters rigid = two_masses();
  rigid.load.elastic = false;
  rigid.load.coulomb_friction_nm = 0.02;
  rigid.load.static_friction_nm = 0.03;
  rigid.load.viscous_friction_nms = 1.0e-4;
  Parameters stiff = rigid;
  stiff.load.elastic = true;
  stiff.load.stiffness_nm_per_rad = 1.0e7;
  stiff.load.damping_nms = 1.0;
  Rig a(rigid);
  Rig b(stiff);
  for (int tick = 0; tick < 8000; ++tick) {
    const double volts = tick < 4000 ? 5.0 : -3.0;
    a.step_voltage(0.0, volts);
    b.step_voltage(0.0, volts);
    // Backward Euler lags by a fraction of a tick during acceleration (here by up to 0.35 rad/s per tick), and not
    // more.
    ASSERT_NEAR(a.speed_rad_s(), b.speed_rad_s(), 0.4) << tick;
  }
  EXPECT_NEAR(a.speed_rad_s(), b.speed_rad_s(), 1.0e-4);
}

TEST(Coupling, LoadMeetsTheStop) {
  Parameters p = two_masses();
  p.load.damping_nms = 0.02;
  p.load.external_torque_nm = -0.3;
  p.load.high_stop_counts = 50000;
  Rig rig(p);
  rig.run(32000);
  EXPECT_NEAR(rig.plant.load_position_counts(), 50000.0, 1.0);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1e-3);
  // The motor pushes: the load stands, and the coupling twists.
  for (int i = 0; i < 16000; ++i) rig.step_voltage(0.0, 1.1);
  EXPECT_NEAR(rig.plant.coupling_twist_rad(), rig.plant.torque_nm() / 100.0, 1e-5);
  EXPECT_NEAR(rig.plant.load_position_counts(), 50000.0, 1.0);
}

}  // namespace
}  // namespace coupling_test
}  // namespace servodrome::plant::test
