#include <gtest/gtest.h>

#include "plant/rig.hpp"

// The motor's electrical side, compared with closed-form solutions and a reference that is integrated in 1 us steps.
namespace servodrome::plant::test {
namespace windings_test {
namespace {

TEST(Windings, LockedRotorCurrentRisesExponentially) {
  for (const double resistance : {0.01, 1.1, 50.0, 1000.0}) {
    Parameters p = bare_motor();
    p.motor.resistance_ohm = resistance;
    p.supply.overcurrent_a = 1.0e5;
    p.supply.source_resistance_ohm = 1.0e-4;
    Rig rig(p);
    rig.plant.lock_rotor(true);
    const double volts = std::min(20.0, resistance * 10.0);
    for (int tick = 1; tick <= 400; ++tick) {
      rig.step_voltage(0.0, volts);
      const double exact =
          volts / resistance * (1.0 - std::exp(-tick * h * resistance / p.motor.quadrature_inductance_h));
      ASSERT_NEAR(rig.plant.current_a(), exact, 2.0e-6 * volts / resistance) << resistance << " ohm, tick " << tick;
    }
    EXPECT_EQ(rig.plant.velocity_rpm(), 0.0);
    EXPECT_EQ(rig.plant.position_counts(), 0);
  }
}

TEST(Windings, TorqueConstantIsPerAmpereRms) {
  const Parameters p = bare_motor();
  Rig rig(p);
  rig.plant.lock_rotor(true);
  for (int i = 0; i < 2000; ++i) rig.step_voltage(0.0, p.motor.resistance_ohm * 2.7 * std::sqrt(2.0));
  EXPECT_NEAR(rig.plant.current_a() / std::sqrt(2.0), 2.7, 1e-4);
  EXPECT_NEAR(rig.plant.torque_nm(), 2.7 * 0.47, 1e-4);
}

// A stationary-frame voltage that rotates and increases; free rotor. Salient and round rotors, with and without
// saturation, both encoder directions.
TEST(Windings, FollowsTheContinuousEquations) {
  for (const auto& [ratio, saturation_a] : {std::pair{1.0, 0.0}, std::pair{1.6, 0.0}, std::pair{1.2, 2.0}}) {
    for (const int direction : {1, -1}) {
      Parameters p = bare_motor();
      p.motor.quadrature_inductance_h = ratio * p.motor.direct_inductance_h;
      p.motor.quadrature_saturation_a = saturation_a;
      p.load.inertia_kgm2 = 0.28e-4;
      p.load.viscous_friction_nms = 1.0e-4;
      p.supply.source_resistance_ohm = 1.0e-4;
      p.encoder.direction = direction;
      Rig rig(p);
      ReferenceMotor reference(p);
      rig.actuation.pwm_enabled = true;
      double worst_current = 0.0;
      double peak_current = 0.0;
      double worst_speed = 0.0;
      double angle = 0.0;
      double frequency = 0.0;
      for (int tick = 0; tick < 8000; ++tick) {
        frequency = std::min(150.0, frequency + 0.02);  // electrical Hz: 1800 rpm at the end
        angle += 2.0 * std::numbers::pi * frequency * h;
        const double amplitude = 8.0 + 0.3 * frequency;
        const double alpha = amplitude * std::cos(angle);
        const double beta = amplitude * std::sin(angle);
        rig.actuation.phase_voltage_v = {static_cast<float>(alpha),
                                         static_cast<float>(-0.5 * alpha + std::sqrt(0.75) * beta),
                                         static_cast<float>(-0.5 * alpha - std::sqrt(0.75) * beta)};
        rig.step();
        reference.advance(h, alpha, beta);
        worst_current = std::max(worst_current, std::hypot(rig.plant.direct_current_a() - reference.state[0],
                                                           direction * rig.plant.current_a() - reference.state[1]));
        peak_current = std::max(peak_current, std::hypot(reference.state[0], reference.state[1]));
        worst_speed = std::max(worst_speed, std::abs(direction * rig.speed_rad_s() - reference.state[2]));
      }
      EXPECT_GT(std::abs(reference.state[2]), 150.0);  // it did accelerate
      EXPECT_LT(worst_current, 0.001 * peak_current);
      EXPECT_LT(worst_speed, 0.001 * 188.0);
    }
  }
}

TEST(Windings, NoLoadSpeedIsWhereTheDcLinkEnds) {
  Parameters p = bare_motor();
  p.motor.viscous_friction_nms = 1.0e-6;
  Rig rig(p);
  for (int i = 0; i < 40000; ++i) rig.step_voltage(0.0, 1.0e3);  // more than the limit
  // The fundamental of the hexagonal voltage limit: between its inner circle Vdc/sqrt(3) and its corners 2/3 Vdc.
  const double flux_speed = flux_linkage_vs(p.motor) * p.motor.pole_pairs;
  const double lowest = 310.0 / std::sqrt(3.0) / flux_speed / rad_s_per_rpm;
  const double highest = 310.0 * 2.0 / 3.0 / flux_speed / rad_s_per_rpm;
  EXPECT_GT(rig.plant.velocity_rpm(), lowest);
  EXPECT_LT(rig.plant.velocity_rpm(), highest);
}

TEST(Windings, ShortCircuitBrakesAsTheEquationsSay) {
  Parameters p = bare_motor();
  p.load.inertia_kgm2 = 1.0e-3;  // heavy, so that each speed is nearly constant
  Rig shorted(p);
  Rig coasting(p);
  shorted.spin_up(3000.0);
  coasting.spin_up(3000.0);
  const double start = coasting.plant.velocity_rpm();
  ReferenceMotor reference(p);
  reference.state[2] = shorted.speed_rad_s();
  shorted.actuation.short_circuit = true;
  for (int tick = 0; tick < 16000; ++tick) {
    shorted.step();
    coasting.step();
    reference.advance(h, 0.0, 0.0);
    ASSERT_NEAR(shorted.speed_rad_s(), reference.state[2], 0.001 * 314.0) << tick;
    if (tick == 800) {
      // Steady braking torque: 3/2 p flux^2 we R / (R^2 + (we L)^2).
      const double we = 5.0 * shorted.speed_rad_s();
      const double x = we * p.motor.direct_inductance_h;
      const double flux = flux_linkage_vs(p.motor);
      const double r = p.motor.resistance_ohm;
      const double exact = -1.5 * 5.0 * flux * flux * we * r / (r * r + x * x);
      EXPECT_NEAR(shorted.plant.torque_nm(), exact, 0.01 * std::abs(exact));
    }
  }
  EXPECT_EQ(coasting.plant.velocity_rpm(), start);  // no brake torque: the back-EMF is below the DC link's voltage
  EXPECT_LT(shorted.plant.velocity_rpm(), 10.0);
}

TEST(Windings, OpenPhaseCarriesNothing) {
  const std::array open{Injection::open_phase_u, Injection::open_phase_v, Injection::open_phase_w};
  for (std::size_t phase = 0; phase < 3; ++phase) {
    Rig rig(bare_motor());
    rig.plant.lock_rotor(true);
    rig.plant.inject(open[phase], true);
    rig.actuation.pwm_enabled = true;
    rig.actuation.phase_voltage_v = {2.0F, -5.0F, 3.0F};
    for (int tick = 0; tick < 2000; ++tick) {
      rig.step();
      ASSERT_EQ(rig.feedback.phase_current_a[phase], 0.0F);
    }
    // The other two in series.
    const auto both_ohm = static_cast<float>(2.0 * bare_motor().motor.resistance_ohm);
    const std::size_t a = (phase + 1) % 3;
    const std::size_t b = (phase + 2) % 3;
    const float between = rig.actuation.phase_voltage_v[a] - rig.actuation.phase_voltage_v[b];
    EXPECT_NEAR(rig.feedback.phase_current_a[a], between / both_ohm, 1e-3);
    EXPECT_NEAR(rig.feedback.phase_current_a[b], -between / both_ohm, 1e-3);
    rig.plant.inject(open[(phase + 1) % 3], true);
    rig.step();
    for (const float current : rig.feedback.phase_current_a) EXPECT_EQ(current, 0.0F);
  }
}

TEST(Windings, ShortedPhaseTripsItsComparator) {
  Rig rig(bare_motor());
  rig.plant.lock_rotor(true);
  rig.actuation.pwm_enabled = true;
  rig.run(10);
  EXPECT_EQ(rig.feedback.hardware_faults, 0u);
  rig.plant.inject(Injection::short_phase_u, true);
  int ticks = 0;
  while (rig.feedback.hardware_faults == 0 && ++ticks < 100) rig.step();
  // 103 V across 3.4 mH: 20 A within 0.7 ms, first in phase U, out of the motor.
  EXPECT_NEAR(ticks, 11, 2);
  EXPECT_EQ(rig.feedback.hardware_faults, static_cast<std::uint32_t>(drive::HardwareFault::overcurrent_u));
  EXPECT_LT(rig.feedback.phase_current_a[0], -20.0F);
}

TEST(Windings, CurrentsDieThroughTheDiodes) {
  Parameters p = bare_motor();
  p.supply.capacitance_f = 0.1;
  const auto [r, l] = std::pair(p.motor.resistance_ohm, p.motor.quadrature_inductance_h);
  Rig rig(p);
  rig.plant.lock_rotor(true);
  for (int i = 0; i < 2000; ++i) rig.step_voltage(0.0, 10.0 * r);
  EXPECT_NEAR(rig.plant.current_a(), 10.0, 1e-3);
  const double before = rig.plant.energy().to_motor_j;
  rig.actuation.pwm_enabled = false;
  // L di/dt = -R i - Vdc / sqrt(3): 10 A in 0.25 ms.
  rig.run(2);
  const double bridge_a = 310.0 / std::sqrt(3.0) / r;
  EXPECT_NEAR(rig.plant.current_a(), (10.0 + bridge_a) * std::exp(-2.0 * h * r / l) - bridge_a, 0.05);
  rig.run(4);
  EXPECT_EQ(rig.plant.current_a(), 0.0);
  EXPECT_LT(rig.plant.energy().to_motor_j, before - 0.6 * 0.75 * l * 100.0);  // most of it went back to the link
}

// Also for currents that end in the middle of a tick, repeatedly.
TEST(Windings, EnergyOfCurrentsThatDieIsKept) {
  Parameters p = bare_motor();
  p.supply.capacitance_f = 0.1;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  const Energy start = rig.plant.energy();
  for (int times = 0; times < 20; ++times) {
    rig.actuation.pwm_enabled = true;
    for (int i = 0; i < 40; ++i) rig.step_voltage(0.0, 1.0 + 2.0 * times);
    rig.actuation.pwm_enabled = false;
    rig.run(20);
    ASSERT_EQ(rig.plant.current_a(), 0.0);
  }
  const Energy end = rig.plant.energy();
  const double kept = end.to_motor_j - end.copper_j - end.shaft_j - (start.to_motor_j - start.copper_j - start.shaft_j);
  EXPECT_GT(end.copper_j, 1.0e-2);
  EXPECT_NEAR(kept, 0.0, 2.0e-2 * end.copper_j);
}

// A link without voltage absorbs no energy from any current; the resistance absorbs it.
TEST(Windings, CurrentsThatDieIntoAnEmptyLinkHeatTheCopper) {
  Parameters p = bare_motor();
  p.motor.resistance_ohm = 20.0;
  p.supply.bleeder_resistance_ohm = 10.0;
  p.supply.capacitance_f = 1.0e-5;
  p.supply.bus_overcurrent_a = 5.0;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  for (int i = 0; i < 400; ++i) rig.step_voltage(0.0, 60.0);
  ASSERT_NEAR(rig.plant.current_a(), 3.0, 0.01);
  rig.actuation.pwm_enabled = false;
  rig.actuation.dc_link_connected = false;
  rig.plant.discharge_dc_link();
  const Energy start = rig.plant.energy();
  for (int tick = 0; tick < 400; ++tick) {
    rig.step();
    ASSERT_EQ(rig.feedback.hardware_faults, 0u) << tick << ", link " << rig.plant.dc_link_v() << " V";
  }
  const Energy end = rig.plant.energy();
  EXPECT_LT(rig.plant.current_a(), 1.0e-9);
  EXPECT_NEAR(end.copper_j - start.copper_j, start.magnetic_j, 0.02 * start.magnetic_j);
  EXPECT_NEAR(end.to_motor_j, start.to_motor_j, 0.02 * start.magnetic_j);
}

TEST(Windings, BackEmfAboveTheLinkFeedsIt) {
  Parameters p = bare_motor();
  p.supply.volts = 48.0;
  p.load.inertia_kgm2 = 1.0e-3;
  Rig rig(p);
  rig.spin_up(3000.0);
  rig.run(3200);
  const double emf_peak = flux_linkage_vs(p.motor) * 5.0 * rig.speed_rad_s() * std::sqrt(3.0);
  // The link charges up to the peak, in pulses that become shorter and shorter: for the last percent, 8 degrees around
  // each peak and a few mA remain.
  EXPECT_GT(rig.plant.dc_link_v(), 0.98 * emf_peak);
  EXPECT_LT(rig.plant.dc_link_v(), 1.01 * emf_peak);
  EXPECT_LT(rig.plant.velocity_rpm(), 3000.0);
}

// Lq decreases with the current: the current rises faster the higher it is, and the reluctance torque is that of the
// remaining inductance.
TEST(Windings, TheQuadratureInductanceSaturates) {
  Parameters p = bare_motor();
  p.motor.quadrature_saturation_a = 8.0;
  const auto [r, l] = std::pair(p.motor.resistance_ohm, p.motor.quadrature_inductance_h);
  p.motor.saturated_inductance_share = 0.3;
  p.supply.source_resistance_ohm = 1.0e-4;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  ReferenceMotor reference(p);
  reference.locked = true;
  for (int tick = 1; tick <= 400; ++tick) {
    rig.step_voltage(-3.0 * r, 15.0 * r);
    reference.advance(h, -3.0 * r, 15.0 * r);
    ASSERT_NEAR(rig.plant.current_a(), reference.state[1], 0.002 * 15.0) << tick;
    ASSERT_NEAR(rig.plant.direct_current_a(), reference.state[0], 0.002 * 15.0) << tick;
  }
  rig.run(1600);
  const double left_h = l * (0.3 + 0.7 / (1.0 + 15.0 / 8.0));
  EXPECT_NEAR(rig.plant.current_a(), 15.0, 0.001);
  EXPECT_NEAR(rig.plant.torque_nm(), 7.5 * (flux_linkage_vs(p.motor) - 3.0 * (l - left_h)) * 15.0, 0.001);
  // After a short circuit the energy in the windings heats the copper.
  const Energy start = rig.plant.energy();
  rig.actuation.short_circuit = true;
  rig.run(1600);
  const Energy end = rig.plant.energy();
  EXPECT_NEAR(end.copper_j - start.copper_j, start.magnetic_j, 1.0e-6 * start.magnetic_j);
  double stored = 0.0;  // integral of current over flux, by the midpoint rule
  for (double i = 0.0005; i < 15.0; i += 0.001) {
    const double share = 1.0 / (1.0 + i / 8.0);
    stored += 1.5 * i * l * (0.3 + 0.7 * share * share) * 0.001;
  }
  EXPECT_NEAR(start.magnetic_j, stored + 0.75 * l * 9.0, 1.0e-4 * stored);
}

// When a high current is switched off, the windings return their energy to the link.
TEST(Windings, ASaturatedMotorGivesItsEnergyBack) {
  Parameters p = bare_motor();
  p.motor.quadrature_saturation_a = 5.0;
  p.supply.bleeder_resistance_ohm = 1.0e9;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  for (int tick = 0; tick < 400; ++tick) rig.step_voltage(0.0, 13.2);
  const Energy start = rig.plant.energy();
  rig.actuation.pwm_enabled = false;
  rig.run(400);
  const Energy end = rig.plant.energy();
  EXPECT_EQ(rig.plant.current_a(), 0.0);
  EXPECT_NEAR(start.to_motor_j - end.to_motor_j + end.copper_j - start.copper_j, start.magnetic_j,
              1.0e-6 * start.magnetic_j);
  EXPECT_GT(start.to_motor_j - end.to_motor_j, 0.9 * start.magnetic_j);
}

// A held shaft uses a separate function without the rotation: the results are equal except for rounding.
TEST(Windings, AHeldShaftNeedsNoRotation) {
  Windings windings(bare_motor().motor, 1);
  for (int i = 0; i < 1000; ++i) {
    windings.direct_a = 3.0 * std::sin(0.7 * i);
    windings.quadrature_a = 5.0 * std::cos(1.3 * i);
    const double direct_v = 40.0 * std::sin(2.1 * i);
    const double quadrature_v = 90.0 * std::cos(0.3 * i);
    const WindingTick rotated = windings.driven(direct_v, quadrature_v, {0.0, 0.0}, {0.0, 0.0});
    const WindingTick held = windings.driven_at_rest(direct_v, quadrature_v);
    ASSERT_EQ(held.mean_direct_a, rotated.mean_direct_a) << i;
    ASSERT_DOUBLE_EQ(held.mean_quadrature_a, rotated.mean_quadrature_a) << i;
    ASSERT_DOUBLE_EQ(held.end_direct_a, rotated.end_direct_a) << i;
    ASSERT_NEAR(held.end_quadrature_a, rotated.end_quadrature_a, 1.0e-13) << i;
    ASSERT_EQ(held.more_heat_a2, rotated.more_heat_a2) << i;
    ASSERT_NEAR(held.power_w, rotated.power_w, 1.0e-11) << i;
    ASSERT_EQ(held.torque_nm, rotated.torque_nm) << i;
    ASSERT_EQ(held.unforeseen_rad_s, rotated.unforeseen_rad_s) << i;
  }
}

}  // namespace
}  // namespace windings_test
}  // namespace servodrome::plant::test
