#include <gtest/gtest.h>

#include "plant/energy_balance.hpp"
#include "plant/rig.hpp"
#include "plant/stepper_motor.hpp"

// A hybrid stepper: two windings in quadrature, each on its own full bridge, compared with closed-form solutions.
namespace servodrome::plant::test {
namespace two_phase_test {
namespace {

constexpr double link = 72.0;
constexpr double detent_nm = 0.18;

Parameters stepper() {
  Parameters p = bare_motor();
  make_stepper(p.motor);
  p.supply.volts = link;
  p.supply.source_resistance_ohm = 1.0e-4;
  p.supply.overcurrent_a = 1.0e5;
  p.supply.bus_overcurrent_a = 1.0e5;
  p.encoder.counts_per_revolution = 200000;
  return p;
}

TEST(TwoPhases, AWindingAloneIsAnInductanceWithItsResistance) {
  for (const std::size_t winding : {0u, 1u}) {
    Rig rig(stepper());
    rig.plant.lock_rotor(true);
    rig.actuation.pwm_enabled = true;
    rig.actuation.phase_voltage_v[winding] = 2.0F;
    for (int tick = 1; tick <= 500; ++tick) {
      rig.step();
      const double exact = 2.0 / 0.4 * (1.0 - std::exp(-tick * h * 0.4 / 2.3e-3));
      ASSERT_NEAR(static_cast<double>(rig.feedback.phase_current_a[winding]), exact, 2.0e-5) << tick;
      ASSERT_NEAR(static_cast<double>(rig.feedback.phase_current_a[1 - winding]), 0.0, 2.0e-5);
      ASSERT_EQ(rig.feedback.phase_current_a[2], 0.0F);
    }
  }
}

// The holding torque of a nameplate: both windings with their current, p flux sqrt(2) I.
TEST(TwoPhases, HoldingTorqueOfTwoWindings) {
  Parameters p = stepper();
  const double flux = flux_linkage_vs(p.motor);
  EXPECT_NEAR(50.0 * flux * std::sqrt(2.0), 0.74, 1e-12);
  Rig rig(p);
  rig.plant.lock_rotor(true);
  rig.plant.set_position_counts(200000 - 500);  // 1/8 of a tooth before the d axis: both windings act against it
  rig.plant.lock_rotor(true);
  rig.actuation.pwm_enabled = true;
  rig.actuation.phase_voltage_v = {0.4F * 6.0F, 0.4F * 6.0F, 0.0F};
  rig.run(3200);
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[0]), 6.0, 1e-4);
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[1]), 6.0, 1e-4);
  EXPECT_NEAR(rig.plant.torque_nm(), 6.0 * 0.74, 1e-3);
  EXPECT_NEAR(rig.plant.current_a(), 6.0 * std::sqrt(2.0), 1e-3);
}

// The bridges do not share the link's voltage: each winding can use all of it.
TEST(TwoPhases, EachWindingHasTheWholeLink) {
  Parameters p = stepper();
  p.motor.resistance_ohm = 10.0;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  rig.actuation.pwm_enabled = true;
  rig.actuation.phase_voltage_v = {1000.0F, -1000.0F, 0.0F};
  rig.run(1000);
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[0]), link / 10.0, 0.01);
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[1]), -link / 10.0, 0.01);
}

// With the voltage circle of a drive, whose radius is the link's voltage: p flux w = link.
TEST(TwoPhases, NoLoadSpeedIsWhereTheLinkEnds) {
  Parameters p = stepper();
  Rig rig(p);
  for (int i = 0; i < 64000; ++i) rig.step_voltage(0.0, link);
  const double exact = link / (50.0 * flux_linkage_vs(p.motor));
  EXPECT_NEAR(rig.speed_rad_s(), exact, 0.01 * exact);
  // A star with the same flux linkage would reach its limit at 1/sqrt(3) of this speed.
  EXPECT_GT(rig.speed_rad_s(), 1.7 * link / std::sqrt(3.0) / (50.0 * flux_linkage_vs(p.motor)));
}

TEST(TwoPhases, FollowsTheContinuousEquations) {
  Parameters p = stepper();
  p.load.inertia_kgm2 = 1.4e-4;
  p.load.viscous_friction_nms = 1.0e-3;
  Rig rig(p);
  ReferenceMotor reference(p);
  rig.actuation.pwm_enabled = true;
  double angle = 0.0;
  double frequency = 0.0;
  double worst_current = 0.0;
  double peak_current = 0.0;
  for (int tick = 0; tick < 16000; ++tick) {
    frequency = std::min(100.0, frequency + 0.01);  // 120 rpm at the end
    angle += 2.0 * std::numbers::pi * frequency * h;
    const double amplitude = 3.0 + 0.12 * frequency;
    rig.set_voltage(amplitude * std::cos(angle), amplitude * std::sin(angle));
    rig.step();
    reference.advance(h, amplitude * std::cos(angle), amplitude * std::sin(angle));
    worst_current = std::max(worst_current, std::hypot(rig.plant.direct_current_a() - reference.state[0],
                                                       rig.plant.current_a() - reference.state[1]));
    peak_current = std::max(peak_current, std::hypot(reference.state[0], reference.state[1]));
  }
  EXPECT_GT(reference.state[2], 10.0);  // it did accelerate
  EXPECT_LT(worst_current, 0.005 * peak_current);
  EXPECT_NEAR(rig.speed_rad_s(), reference.state[2], 0.005 * reference.state[2]);
}

// The rotor rests where a single winding would hold it: 200 positions per revolution with 50 teeth.
TEST(TwoPhases, DetentHasFourPlacesPerTooth) {
  Parameters p = stepper();
  p.motor.cogging_torque_nm = detent_nm;
  p.motor.cogging_periods_per_revolution = 200;
  p.load.viscous_friction_nms = 0.05;
  for (const std::int64_t place : {0, 1, 2, 3, 77, 199}) {
    Rig rig(p);
    rig.plant.set_position_counts(place * 1000 + 300);
    rig.run(16000);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()) + rig.plant.position_fraction(),
                static_cast<double>(place) * 1000.0, 0.5);
  }
}

TEST(TwoPhases, DetentHoldsItsTorqueAndNoMore) {
  Parameters p = stepper();
  p.motor.cogging_torque_nm = detent_nm;
  p.motor.cogging_periods_per_revolution = 200;
  p.load.viscous_friction_nms = 0.05;
  for (const double share : {0.5, 0.98, 1.02}) {
    Rig rig(p);
    for (int i = 1; i <= 1000; ++i) {  // without an impact
      rig.plant.set_external_torque_nm(share * detent_nm * i / 1000.0);
      rig.run(16);
    }
    rig.run(16000);
    const double counts = static_cast<double>(rig.plant.position_counts()) + rig.plant.position_fraction();
    if (share < 1.0) {
      EXPECT_NEAR(counts, -1000.0 / (2.0 * std::numbers::pi) * std::asin(share), 1.0);
    } else {
      EXPECT_LT(counts, -1000.0);
    }
  }
}

TEST(TwoPhases, EnergyBalances) {
  Parameters p = stepper();
  p.load.inertia_kgm2 = 2.0e-3;
  p.load.viscous_friction_nms = 2.0e-3;
  expect_energy_balance(p, 10.0, [](Rig& rig, int tick, double angle) {
    rig.actuation.short_circuit = tick % 4000 < 200;
    rig.step_voltage(-1.0 * std::sin(angle), 20.0 * std::sin(angle) + 1.0 * std::sin(11.0 * angle));
  });
}

// L di/dt = -R i - link: the full bridge applies the whole link voltage against the current.
TEST(TwoPhases, CurrentDiesAgainstTheWholeLink) {
  Parameters p = stepper();
  p.supply.capacitance_f = 0.1;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  rig.actuation.pwm_enabled = true;
  rig.actuation.phase_voltage_v = {4.0F, 0.0F, 0.0F};
  rig.run(1600);
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[0]), 10.0, 1e-3);
  rig.actuation.pwm_enabled = false;
  rig.run(2);
  const double bridge_a = link / 0.4;
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[0]),
              (10.0 + bridge_a) * std::exp(-2.0 * h * 0.4 / 2.3e-3) - bridge_a, 0.05);
  rig.run(6);
  EXPECT_EQ(rig.feedback.phase_current_a[0], 0.0F);
}

TEST(TwoPhases, OpenWindingCarriesNothingAndTheOtherAll) {
  const std::array open{Injection::open_phase_u, Injection::open_phase_v};
  for (std::size_t winding = 0; winding < 2; ++winding) {
    Rig rig(stepper());
    rig.plant.lock_rotor(true);
    rig.plant.inject(open[winding], true);
    rig.actuation.pwm_enabled = true;
    rig.actuation.phase_voltage_v = {2.0F, -1.6F, 0.0F};
    for (int tick = 0; tick < 2000; ++tick) {
      rig.step();
      ASSERT_EQ(rig.feedback.phase_current_a[winding], 0.0F);
    }
    const std::size_t other = 1 - winding;
    EXPECT_NEAR(rig.feedback.phase_current_a[other], rig.actuation.phase_voltage_v[other] / 0.4F, 1e-3);
    rig.plant.inject(open[other], true);
    rig.step();
    for (const float current : rig.feedback.phase_current_a) EXPECT_EQ(current, 0.0F);
  }
}

TEST(TwoPhases, ThereIsNoWireW) {
  Rig rig(stepper());
  Rig sound(stepper());
  rig.plant.inject(Injection::open_phase_w, true);
  rig.plant.inject(Injection::short_phase_w, true);
  for (int tick = 0; tick < 1000; ++tick) {
    rig.step_voltage(0.0, 5.0);
    sound.step_voltage(0.0, 5.0);
    ASSERT_EQ(rig.feedback.phase_current_a, sound.feedback.phase_current_a);
  }
}

// One end is on the negative rail, the other at the middle of the link's voltage: half of the link's voltage is across
// the winding. The comparator responds while the bridge is active.
TEST(TwoPhases, ShortedWindingTripsItsComparator) {
  Parameters p = stepper();
  Rig rig(p);
  rig.plant.lock_rotor(true);
  rig.actuation.pwm_enabled = true;
  rig.run(10);
  EXPECT_EQ(rig.feedback.hardware_faults, 0u);
  rig.plant.inject(Injection::short_phase_v, true);
  rig.run(20);
  EXPECT_EQ(rig.feedback.hardware_faults, static_cast<std::uint32_t>(drive::HardwareFault::overcurrent_v));
  // 36 V across 2.3 mH and 0.4 ohm: -R i = 36 (1 - exp(-t R / L)).
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[1]),
              -36.0 / 0.4 * (1.0 - std::exp(-20.0 * h * 0.4 / 2.3e-3)), 0.05);
  EXPECT_NEAR(static_cast<double>(rig.feedback.phase_current_a[0]), 0.0, 1e-6);
  rig.actuation.pwm_enabled = false;
  rig.step();
  EXPECT_EQ(rig.feedback.hardware_faults, 0u);
}

}  // namespace
}  // namespace two_phase_test
}  // namespace servodrome::plant::test
