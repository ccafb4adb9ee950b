#include <gtest/gtest.h>

#include "plant/rig.hpp"

namespace servodrome::plant::test {
namespace dc_link_test {
namespace {

TEST(DcLink, PrechargesAfterTheRelayCloses) {
  Parameters p = bare_motor();
  p.supply.charged_at_start = false;
  p.supply.bleeder_resistance_ohm = 1.0e9;
  Rig rig(p);
  rig.actuation.dc_link_connected = false;
  rig.run(1600);
  EXPECT_EQ(rig.plant.dc_link_v(), 0.0);
  rig.actuation.dc_link_connected = true;
  for (int tick = 1; tick <= 480; ++tick) {  // 30 ms: one time constant
    rig.step();
    ASSERT_NEAR(rig.plant.dc_link_v(), 310.0 * (1.0 - std::exp(-tick * h / 0.03)), 0.01);
  }
  rig.run(1600);
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0, 0.1);
}

// A link that is charged at the start has its relay closed: when the supply rises, the link charges through the
// supply's resistance of 0.3 ohm, not through the precharge resistor.
TEST(DcLink, ChargedAtTheStartItFollowsTheSupplyAtOnce) {
  Rig rig(bare_motor());
  rig.plant.set_supply_v(350.0);
  for (int tick = 1; tick <= 16; ++tick) {
    rig.step();
    const double tau = bare_motor().supply.source_resistance_ohm * bare_motor().supply.capacitance_f;
    ASSERT_NEAR(rig.plant.dc_link_v(), 350.0 - 40.0 * std::exp(-tick * h / tau), 0.1);
  }
}

TEST(DcLink, BleederDischargesItWithTheRelayOpen) {
  Parameters p = bare_motor();
  Rig rig(p);
  rig.actuation.dc_link_connected = false;
  rig.run(16000);
  const double tau = p.supply.bleeder_resistance_ohm * p.supply.capacitance_f;
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0 * std::exp(-1.0 / tau), 0.01);
}

// The drive's electronics draw their power from the link only if the supply does not feed them.
TEST(DcLink, ElectronicsEmptyItWithoutTheSupply) {
  Parameters p = bare_motor();
  p.supply.bleeder_resistance_ohm = 1.0e9;
  p.supply.standby_w = 10.0;
  Rig rig(p);
  rig.run(16000);
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0, 1.0e-6) << "the supply carries them";
  EXPECT_EQ(rig.plant.energy().standby_j, 0.0);
  rig.plant.set_supply_v(0.0);
  rig.run(16000);  // 10 J
  const double left_v = std::sqrt(310.0 * 310.0 - 2.0 * 10.0 / p.supply.capacitance_f);
  EXPECT_NEAR(rig.plant.dc_link_v(), left_v, 0.01);
  EXPECT_NEAR(rig.plant.energy().standby_j, 10.0, 1.0e-3);
  rig.run(16000 * 5);
  EXPECT_EQ(rig.plant.dc_link_v(), 0.0) << "and no further";
  EXPECT_NEAR(rig.plant.energy().standby_j, 0.5 * p.supply.capacitance_f * 310.0 * 310.0, 0.01)
      << "no more than there was";
  rig.plant.set_supply_v(310.0);
  rig.run(16000);
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0, 1.0e-3) << "it comes back";
}

TEST(DcLink, SagsByTheSourceResistance) {
  Parameters p = bare_motor();
  p.supply.source_resistance_ohm = 5.0;
  p.supply.bleeder_resistance_ohm = 1.0e9;
  p.supply.bus_overcurrent_a = 1.0e3;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  for (int i = 0; i < 8000; ++i) rig.step_voltage(0.0, 15.0 * p.motor.resistance_ohm);
  // With the power stage: 5 W of the PWM, 0.1 ohm in each phase.
  const double power = 1.5 * p.motor.resistance_ohm * 15.0 * 15.0 + 5.0 + 1.5 * 15.0 * 15.0 * 0.1;
  const double current = (310.0 - std::sqrt(310.0 * 310.0 - 4.0 * 5.0 * power)) / 10.0;
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0 - 5.0 * current, 0.02);
}

// The energy of braking, minus the heat of the windings, must be in the capacitor or in the chopper.
TEST(DcLink, RegenerationRaisesItAndTheChopperHoldsIt) {
  for (const bool with_chopper : {false, true}) {
    Parameters p = bare_motor();
    p.load.inertia_kgm2 = 1.0e-3;
    Rig rig(p);
    rig.spin_up(3000.0);
    const Energy before = rig.plant.energy();
    double highest = 0.0;
    bool chopping = false;
    while (rig.plant.velocity_rpm() > 1000.0) {
      // A simple current controller for about -4 A.
      const double we = 5.0 * rig.speed_rad_s();
      const double flux = flux_linkage_vs(p.motor);
      rig.step_voltage(we * p.motor.quadrature_inductance_h * 4.0, we * flux - p.motor.resistance_ohm * 4.0);
      highest = std::max(highest, rig.plant.dc_link_v());
      if (with_chopper) {
        if (rig.plant.dc_link_v() > 380.0) chopping = true;
        if (rig.plant.dc_link_v() < 370.0) chopping = false;
        rig.actuation.chopper_on = chopping;
      }
    }
    const Energy after = rig.plant.energy();
    const double given = (before.kinetic_j - after.kinetic_j) - (after.copper_j - before.copper_j) -
                         (after.magnetic_j - before.magnetic_j);
    const double found = (after.link_stored_j - before.link_stored_j) + (after.chopped_j - before.chopped_j) +
                         (after.stage_j - before.stage_j) - (after.supplied_j - before.supplied_j);
    EXPECT_GT(given, 30.0);
    EXPECT_NEAR(found, given, 1.0e-3 * given);
    if (with_chopper) {
      EXPECT_LT(highest, 383.0);
      EXPECT_GT(after.chopped_j - before.chopped_j, 10.0);
    } else {
      EXPECT_GT(highest, 420.0);
    }
  }
}

// Without load the link has the peak voltage of the mains. With load it falls between two peaks, by power / (C V) times
// the time from a peak to the next half wave: 100 peaks per second with one phase, 300 with three.
TEST(DcLink, MainsHaveARipple) {
  for (const int phases : {1, 3}) {
    for (const double hz : {50.0, 60.0}) {
      Parameters p = bare_motor();
      p.supply.mains_phases = phases;
      p.supply.mains_hz = hz;
      p.supply.source_resistance_ohm = 1.0e-3;
      p.supply.capacitance_f = 200.0e-6;
      p.supply.bleeder_resistance_ohm = 1.0e9;
      p.supply.bus_overcurrent_a = 1.0e3;
      p.thermal.stage_standby_w = 0.0;
      p.thermal.stage_resistance_ohm = 0.0;
      Rig rig(p);
      rig.plant.lock_rotor(true);
      rig.run(1600);
      EXPECT_NEAR(rig.plant.dc_link_v(), 310.0, 0.02);
      const double v = 10.0 * p.motor.resistance_ohm;  // 10 A
      for (int i = 0; i < 1600; ++i) rig.step_voltage(0.0, v);
      double least = 1.0e9;
      double most = 0.0;
      int peaks = 0;
      bool falls = false;
      for (int i = 0; i < 16000; ++i) {
        const double before = rig.plant.dc_link_v();
        rig.step_voltage(0.0, v);
        const double now = rig.plant.dc_link_v();
        if (!falls && now < before) ++peaks;
        falls = now < before;
        least = std::min(least, now);
        most = std::max(most, now);
      }
      // After a peak the link follows the mains until the mains fall faster, and then discharges to the next half wave.
      const double power = 1.5 * v * 10.0;
      const double w = 2.0 * std::numbers::pi * hz;
      double t = 0.0;
      while (310.0 * w * std::sin(w * t) < power / (200.0e-6 * 310.0 * std::cos(w * t))) t += 1.0e-6;
      double volts = 310.0 * std::cos(w * t);
      const double next = 1.0 / (phases == 1 ? 2.0 * hz : 6.0 * hz);
      while (t < next && volts > 310.0 * std::cos(w * (next - t))) {
        t += 1.0e-6;
        volts -= power / (200.0e-6 * volts) * 1.0e-6;
      }
      SCOPED_TRACE(testing::Message() << phases << " phases, " << hz << " Hz");
      EXPECT_NEAR(peaks, phases == 1 ? 2.0 * hz : 6.0 * hz, 1.0);
      EXPECT_NEAR(310.0 - least, 310.0 - volts, 0.03 * (310.0 - volts) + 0.2);
      EXPECT_NEAR(most, 310.0, 0.2);
    }
  }
}

TEST(DcLink, MainsPrechargeItToTheirPeak) {
  Parameters p = bare_motor();
  p.supply.charged_at_start = false;
  p.supply.mains_phases = 1;
  Rig rig(p);
  rig.run(16000);
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0, 1.0);
  rig.actuation.dc_link_connected = false;
  rig.run(16);
  const double before = rig.plant.dc_link_v();
  rig.run(1600);
  EXPECT_LT(rig.plant.dc_link_v(), before);
}

TEST(DcLink, BrokenChopperAndLostSupply) {
  Rig rig(bare_motor());
  rig.plant.inject(Injection::supply_loss, true);
  rig.plant.inject(Injection::chopper_broken, true);
  rig.actuation.chopper_on = true;
  rig.run(160);
  EXPECT_GT(rig.plant.dc_link_v(), 309.0);
  rig.plant.inject(Injection::chopper_broken, false);
  rig.run(160);
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0 * std::exp(-0.01 / (40.0 * 680.0e-6)), 0.5);
  rig.plant.inject(Injection::supply_loss, false);
  rig.actuation.chopper_on = false;
  rig.run(8000);
  EXPECT_NEAR(rig.plant.dc_link_v(), 310.0, 0.1);
  rig.plant.discharge_dc_link();
  EXPECT_EQ(rig.plant.dc_link_v(), 0.0);
}

TEST(DcLink, BusComparator) {
  Parameters p = bare_motor();
  p.supply.bus_overcurrent_a = 0.5;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  const auto volts_of = [&](double watts) { return std::sqrt(watts * p.motor.resistance_ohm / 1.5); };
  for (int i = 0; i < 2000; ++i) rig.step_voltage(0.0, volts_of(165.0));  // 0.53 A
  EXPECT_EQ(rig.feedback.hardware_faults, static_cast<std::uint32_t>(drive::HardwareFault::bus_overcurrent));
  for (int i = 0; i < 2000; ++i) rig.step_voltage(0.0, volts_of(136.0));
  EXPECT_EQ(rig.feedback.hardware_faults, 0u);
}

}  // namespace
}  // namespace dc_link_test
}  // namespace servodrome::plant::test
