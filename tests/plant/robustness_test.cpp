#include <algorithm>
#include <cstring>
#include <gtest/gtest.h>
#include <random>

#include "draws.hpp"
#include "plant/energy_balance.hpp"
#include "plant/rig.hpp"

// Any valid machine with any actuation: all values are finite and bounded, energy is not created, and two runs are
// identical to the bit.
namespace servodrome::plant::test {
namespace robustness_test {
namespace {

class RandomMachine {
 public:
  explicit RandomMachine(std::uint64_t seed) : random_(seed) {}

  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1.0p-53;
  }
  double decades(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  bool chance(unsigned one_in) { return random_() % one_in == 0; }
  double maybe(double low, double high) { return chance(3) ? 0.0 : decades(low, high); }

  Parameters parameters() {
    Parameters p;
    Motor& m = p.motor;
    m.phases = chance(2) ? 2 : 3;
    m.pole_pairs = 1 + static_cast<int>(random_() % 100);
    m.resistance_ohm = decades(1e-3, 1e3);
    m.direct_inductance_h = decades(1e-5, 0.1);
    m.quadrature_inductance_h = m.direct_inductance_h * (chance(2) ? 1.0 : decades(0.11, 9.0));
    m.rotor_inertia_kgm2 = decades(1e-8, 10.0);
    const double inductance = std::min(m.direct_inductance_h, m.quadrature_inductance_h);
    const double factor = 0.5 * m.phases;
    const double largest = factor * std::sqrt(2.0) * 0.999 / h * std::sqrt(m.rotor_inertia_kgm2 * inductance / factor);
    m.torque_constant_nm_per_a = decades(1e-4, std::clamp(largest, 1.01e-4, 1e3));
    if (largest < 1.02e-4) m.direct_inductance_h = m.quadrature_inductance_h = 0.01;
    m.viscous_friction_nms = maybe(1e-9, 1e3);
    m.coulomb_friction_nm = maybe(1e-6, 1e5);
    m.brake_torque_nm = maybe(1e-3, 1e5);
    m.cogging_periods_per_revolution = 1 + static_cast<int>(random_() % 200);
    if (chance(4)) {
      const double most = m.rotor_inertia_kgm2 / (h * h * m.cogging_periods_per_revolution);
      m.cogging_torque_nm = between(0.0, std::min(1000.0, 0.99 * most));
    }
    if (chance(3)) {
      m.quadrature_saturation_a = decades(0.01, 1e3);
      m.saturated_inductance_share = between(0.1, 1.0);
      m.quadrature_inductance_h /= m.saturated_inductance_share;  // keeps the rotor's oscillation slow enough
      if (m.quadrature_inductance_h > 9.9 * m.direct_inductance_h) m.quadrature_inductance_h = m.direct_inductance_h;
      if (m.quadrature_inductance_h == m.direct_inductance_h) m.saturated_inductance_share = 1.0;
    }
    m.iron_hysteresis_nm = chance(3) ? maybe(1e-6, 1e3) : 0.0;
    m.iron_eddy_nms = chance(3) ? maybe(1e-9, 1e2) : 0.0;
    m.brake_rise_ms = chance(3) ? m.brake_engage_ms : 0.0;
    m.brake_half_torque_j = chance(3) ? decades(1e-6, 1e6) : 0.0;
    Load& l = p.load;
    l.elastic = chance(2);
    l.inertia_kgm2 = l.elastic ? decades(1e-8, 1e3) : maybe(1e-8, 1e3);
    l.viscous_friction_nms = maybe(1e-9, 1e3);
    l.coulomb_friction_nm = maybe(1e-6, 1e4);
    l.static_friction_nm = l.coulomb_friction_nm * (chance(2) ? 1.0 : between(1.0, 3.0));
    if (chance(3)) l.stribeck_speed_rad_s = decades(1e-6, 1e4);
    l.cycle_revolutions = decades(1e-3, 1e6);
    l.cycle_offset_turns = between(0.0, 0.999);
    if (chance(3)) l.crank_inertia_kgm2 = decades(1e-8, 1e3);
    l.crank_ratio = between(0.0, 0.9);
    if (chance(4)) {
      const double inertia = l.inertia_kgm2 + (l.elastic ? 0.0 : m.rotor_inertia_kgm2);
      const double most = std::min(1e5, 0.3 * inertia * l.cycle_revolutions / (h * h));
      l.arm_torque_nm = between(-most, most);
      l.crank_torque_nm = between(-most, most);
    }
    if (chance(3)) l.belt_length_revolutions = decades(0.1, 1e3);
    l.gravity_torque_nm = between(-1.0, 1.0) * maybe(1e-6, 1e5);
    l.external_torque_nm = between(-1.0, 1.0) * maybe(1e-6, 1e5);
    l.stiffness_nm_per_rad = decades(1e-3, 1e8);
    l.damping_nms = maybe(1e-6, 1e4);
    l.backlash_rad = maybe(1e-6, 6.0);
    if (chance(2)) l.low_stop_counts = -static_cast<std::int64_t>(random_() % 1000);
    if (chance(2)) l.high_stop_counts = 2 + static_cast<std::int64_t>(random_() % 1000);
    l.stop_stiffness_nm_per_rad = decades(1e-3, 1e9);
    l.stop_damping_nms = maybe(1e-6, 1e5);
    Supply& s = p.supply;
    s.volts = decades(1.0, 2000.0);
    if (chance(4)) s.mains_phases = chance(2) ? 1 : 3;
    s.mains_hz = decades(1.0, 1000.0);
    s.source_resistance_ohm = decades(1e-4, 1e3);
    s.capacitance_f = decades(1e-6, 10.0);
    s.precharge_time_constant_s = maybe(1e-5, 10.0);
    s.chopper_resistance_ohm = decades(0.1, 1e6);
    s.bleeder_resistance_ohm = decades(1.0, 1e9);
    s.charged_at_start = chance(2);
    Encoder& e = p.encoder;
    e.counts_per_revolution = static_cast<std::int32_t>(decades(1.0, 16777216.0));
    e.direction = chance(2) ? 1 : -1;
    e.commutation_offset_turns = between(0.0, 0.999);
    e.index_width_counts = e.counts_per_revolution > 1 ? 1 : 0;
    p.switch_count = random_() % 3;
    for (std::size_t i = 0; i < p.switch_count; ++i) {
      p.switches[i].wire = static_cast<std::uint8_t>(i);
      p.switches[i].from_counts = static_cast<std::int64_t>(random_() % 1000) - 500;
      p.switches[i].hysteresis_counts = static_cast<std::int64_t>(random_() % 10);
    }
    return p;
  }

  void actuate(drive::Actuation& a) {
    a.pwm_enabled = !chance(4);
    a.short_circuit = chance(6);
    a.brake_released = !chance(6);
    a.dc_link_connected = !chance(6);
    a.chopper_on = chance(3);
    const double scale = decades(0.1, 3000.0);
    for (float& volts : a.phase_voltage_v) volts = static_cast<float>(between(-scale, scale));
    if (chance(50)) a.phase_voltage_v[0] = std::numeric_limits<float>::quiet_NaN();
    if (chance(50)) a.phase_voltage_v[1] = std::numeric_limits<float>::infinity();
  }
  std::uint64_t number() { return random_(); }

 private:
  std::mt19937_64 random_;
};

bool sensible(const Plant& plant, const drive::Feedback& f) {
  bool good = std::isfinite(plant.current_a()) && std::isfinite(plant.direct_current_a()) &&
              std::isfinite(plant.torque_nm()) && std::isfinite(plant.dc_link_v()) && plant.dc_link_v() >= 0.0;
  good = good && std::abs(plant.velocity_rpm()) <= 1.0e6 && std::abs(plant.load_velocity_rpm()) <= 1.0e6;
  good = good && std::isfinite(plant.coupling_twist_rad()) && std::isfinite(plant.winding_temperature_c());
  good = good && plant.position_fraction() >= 0.0 && plant.position_fraction() < 1.0 && f.edge_count <= 4;
  good = good && std::isfinite(f.phase_current_a[0]) && std::isfinite(f.phase_current_a[1]);
  return good && f.single_turn_counts < static_cast<std::uint32_t>(plant.parameters().encoder.counts_per_revolution);
}

TEST(Robustness, AnyMachineStaysFiniteUnderAnyActuation) {
  for (int seed = 0; seed < servodrome::test::draws(25'000); ++seed) {
    RandomMachine machine(static_cast<std::uint64_t>(seed));
    const Parameters p = machine.parameters();
    ASSERT_EQ(validate(p), std::vector<std::string>{}) << seed;
    Rig rig(p);
    for (int tick = 0; tick < 60; ++tick) {
      if (tick % 6 == 0) {
        machine.actuate(rig.actuation);
        if (machine.chance(8)) {
          rig.plant.inject(injection_names[machine.number() % injection_names.size()].injection, machine.chance(2));
        }
        if (machine.chance(20)) rig.plant.lock_rotor(machine.chance(2));
      }
      rig.step();
      ASSERT_TRUE(sensible(rig.plant, rig.feedback)) << "seed " << seed << " tick " << tick;
    }
  }
}

// Nothing feeds the machine: relay open, no external torque, bridge off or shorted. Kinetic, elastic and electric
// energy may only decrease. (Excluded are cogging and weights, which exchange energy with the rotor, a belt, which
// loses a little of it along its travel, and the supply.)
TEST(Robustness, EnergyNeverGrowsByItself) {
  for (int seed = 0; seed < servodrome::test::draws(25'000); ++seed) {
    RandomMachine machine(static_cast<std::uint64_t>(seed) ^ 0x5eedu);
    Parameters p = machine.parameters();
    p.load.gravity_torque_nm = p.load.arm_torque_nm = p.load.crank_torque_nm = 0.0;
    p.load.belt_length_revolutions = 0.0;
    p.motor.cogging_torque_nm = 0.0;
    Rig rig(p);
    // A start with stored energy.
    rig.actuation.pwm_enabled = true;
    rig.actuation.phase_voltage_v = {static_cast<float>(p.supply.volts), 0.0F, -static_cast<float>(p.supply.volts)};
    rig.run(10);
    rig.plant.set_external_torque_nm(0.0);
    rig.actuation.pwm_enabled = false;
    rig.actuation.dc_link_connected = false;
    const auto total = [&] {
      const Energy e = rig.plant.energy();
      return e.kinetic_j + e.elastic_j + e.magnetic_j + e.link_stored_j;
    };
    double before = total();
    for (int tick = 0; tick < 60; ++tick) {
      if (tick % 10 == 0) {
        rig.actuation.short_circuit = machine.chance(2);
        rig.actuation.brake_released = !machine.chance(4);
        rig.actuation.chopper_on = machine.chance(2);
      }
      rig.step();
      // Speeds are limited at a value that no bearing reaches; the energy that this limit removes is missing in the
      // balance.
      if (std::abs(rig.plant.load_velocity_rpm()) * rad_s_per_rpm > 0.99 * Shaft::largest_speed_rad_s) break;
      const double after = total();
      ASSERT_LE(after, before * (1.0 + 1.0e-9) + 1.0e-15) << "seed " << seed << " tick " << tick;
      before = after;
    }
  }
}

TEST(Robustness, TheSameRunGivesTheSameBits) {
  for (int seed = 0; seed < servodrome::test::draws(200); ++seed) {
    drive::Feedback last[2];
    for (drive::Feedback& feedback : last) {
      RandomMachine machine(static_cast<std::uint64_t>(seed));
      Parameters p = machine.parameters();
      p.stage.ideal = p.sensors.ideal = false;
      p.sensors.seed = static_cast<std::uint32_t>(seed);
      Rig rig(p);
      for (int tick = 0; tick < 2000; ++tick) {
        if (tick % 20 == 0) machine.actuate(rig.actuation);
        rig.step();
      }
      feedback = rig.feedback;
    }
    ASSERT_EQ(last[0].position_counts, last[1].position_counts);
    ASSERT_EQ(0, std::memcmp(last[0].phase_current_a.data(), last[1].phase_current_a.data(), sizeof(float) * 3));
    ASSERT_EQ(0, std::memcmp(&last[0].dc_link_v, &last[1].dc_link_v, sizeof(float)));
    ASSERT_EQ(0, std::memcmp(&last[0].winding_temperature_c, &last[1].winding_temperature_c, sizeof(float)));
  }
}

TEST(Robustness, EnergyBalances) {
  Parameters p = bare_motor();
  p.load.inertia_kgm2 = 2.0e-4;
  p.load.viscous_friction_nms = 2.0e-4;
  expect_energy_balance(p, 50.0, [](Rig& rig, int, double angle) {
    rig.step_voltage(-3.0 * std::sin(angle), 60.0 * std::sin(angle) + 5.0 * std::sin(11.0 * angle));
  });
}

// Every effect that docs/line-file.md lists, with a rigid and with an elastic load.
TEST(Robustness, EnergyBalancesWithEveryEffect) {
  for (const bool elastic : {false, true}) {
    Parameters p = bare_motor();
    p.motor.quadrature_saturation_a = 12.0;
    p.motor.magnet_temperature_coefficient = 1.1e-3;
    p.motor.copper_temperature_coefficient = 3.93e-3;
    p.motor.iron_hysteresis_nm = 0.01;
    p.motor.iron_eddy_nms = 5.0e-5;
    p.motor.cogging_torque_nm = 0.01;
    p.motor.cogging[0] = {.torque_nm = 0.004, .periods = 60, .phase_turns = 0.3};
    p.motor.cogging_count = 1;
    p.motor.brake_torque_nm = 0.4;
    p.motor.brake_rise_ms = 10.0;
    p.motor.brake_half_torque_j = 500.0;
    p.load.inertia_kgm2 = 2.0e-4;
    p.load.viscous_friction_nms = 1.0e-4;
    p.load.coulomb_friction_nm = 0.02;
    p.load.static_friction_nm = 0.05;
    p.load.stribeck_speed_rad_s = 3.0;
    p.load.cycle_revolutions = 3.0;
    p.load.arm_torque_nm = 0.1;
    p.load.crank_inertia_kgm2 = 1.0e-4;
    p.load.crank_torque_nm = 0.05;
    p.load.crank_ratio = 0.2;
    p.load.elastic = elastic;
    p.load.stiffness_nm_per_rad = 100.0;
    p.load.damping_nms = 0.02;
    p.load.belt_length_revolutions = 40.0;
    p.supply.mains_phases = 1;
    p.stage.ideal = p.sensors.ideal = false;
    SCOPED_TRACE(elastic ? "elastic" : "rigid");
    expect_energy_balance(p, 40.0, [](Rig& rig, int tick, double angle) {
      rig.actuation.brake_released = tick % 8000 < 7000;
      rig.step_voltage(-3.0 * std::sin(angle), 60.0 * std::sin(angle) + 5.0 * std::sin(11.0 * angle));
    });
  }
}

}  // namespace
}  // namespace robustness_test
}  // namespace servodrome::plant::test
