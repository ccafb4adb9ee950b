#include "plant/heat.hpp"

#include <gtest/gtest.h>

#include "plant/rig.hpp"

namespace servodrome::plant::test {
namespace heat_test {
namespace {

constexpr double heat_step = Heat::ticks_per_step * h;

TEST(Heat, SteadyTemperatures) {
  const Thermal t;
  Heat heat(t);
  for (int i = 0; i < 6'000'000; ++i) heat.step(24.0, 10.0);
  EXPECT_NEAR(heat.case_c, 25.0 + 24.0 * 1.8, 1e-6);
  EXPECT_NEAR(heat.winding_c, 25.0 + 24.0 * 2.8, 1e-6);
  EXPECT_NEAR(heat.stage_c, 25.0 + 10.0 * 1.5, 1e-6);
}

TEST(Heat, TimeConstants) {
  // The winding alone (the case has a huge capacity); then the case alone (the winding has almost none).
  Thermal t;
  t.case_heat_capacity_j_per_k = 1.0e7;
  Heat winding(t);
  const int tau_steps = static_cast<int>(60.0 * 1.0 / heat_step);
  for (int i = 0; i < tau_steps; ++i) winding.step(20.0, 0.0);
  EXPECT_NEAR(winding.winding_c - 25.0, 20.0 * (1.0 - std::exp(-1.0)), 0.01);
  Heat stage(t);
  const int stage_steps = static_cast<int>(200.0 * 1.5 / heat_step);
  for (int i = 0; i < stage_steps; ++i) stage.step(0.0, 20.0);
  EXPECT_NEAR(stage.stage_c - 25.0, 30.0 * (1.0 - std::exp(-1.0)), 0.01);

  t = Thermal{};
  t.winding_heat_capacity_j_per_k = 0.01;
  Heat both(t);
  const int case_steps = static_cast<int>(400.0 * 1.8 / heat_step);
  for (int i = 0; i < case_steps; ++i) both.step(10.0, 0.0);
  EXPECT_NEAR(both.case_c - 25.0, 18.0 * (1.0 - std::exp(-1.0)), 0.01);
}

TEST(Heat, WarmCopperResistsMore) {
  Parameters p = bare_motor();
  p.motor.copper_temperature_coefficient = 3.93e-3;
  p.thermal.winding_heat_capacity_j_per_k = 1.0;
  p.thermal.winding_to_case_k_per_w = 2.0;
  p.thermal.case_heat_capacity_j_per_k = 1.0e7;
  Rig rig(p);
  rig.plant.lock_rotor(true);
  for (int i = 0; i < 16 * 16000; ++i) rig.step_voltage(0.0, 5.5);
  // Steady: power = 1.5 V^2 / R, R = R25 (1 + alpha dT), dT = 2 power.
  double rise = 0.0;
  for (int i = 0; i < 100; ++i) rise = 2.0 * 1.5 * 5.5 * 5.5 / (p.motor.resistance_ohm * (1.0 + 3.93e-3 * rise));
  EXPECT_NEAR(rig.plant.winding_temperature_c(), 25.0 + rise, 0.1);
  EXPECT_NEAR(rig.plant.current_a(), 5.5 / (p.motor.resistance_ohm * (1.0 + 3.93e-3 * rise)), 0.005);
  EXPECT_NEAR(rig.feedback.winding_temperature_c, rig.plant.winding_temperature_c(), 1e-4);
}

// The magnets have the temperature of the case: at 65 degC, 0.11 % per K reduce torque and back-EMF by 4.4 %.
TEST(Heat, WarmMagnetsAreWeaker) {
  Parameters p = bare_motor();
  p.motor.magnet_temperature_coefficient = 1.1e-3;
  p.thermal.case_heat_capacity_j_per_k = p.thermal.winding_heat_capacity_j_per_k = 0.1;
  p.load.inertia_kgm2 = 1.0e-3;
  for (const double ambient_c : {25.0, 65.0}) {
    const double share = 1.0 - 1.1e-3 * (ambient_c - 25.0);
    p.thermal.ambient_c = 25.0;
    Rig standing(p);
    standing.plant.lock_rotor(true);
    standing.plant.set_ambient_c(ambient_c);
    standing.run(48000);  // without current
    for (int i = 0; i < 400; ++i) standing.step_voltage(0.0, 0.01);
    // Without reluctance the torque is the constant times the current.
    const double per_a = standing.plant.torque_nm() / standing.plant.current_a();
    EXPECT_NEAR(per_a, share * 0.47 / std::sqrt(2.0), 3.0e-4 * per_a);
    p.thermal.ambient_c = ambient_c;  // at this temperature from the start
    Rig turning(p);
    turning.spin_up(1000.0);
    turning.step_voltage(0.0, 0.0);
    const double emf_v = turning.speed_rad_s() * 5.0 * flux_linkage_vs(p.motor) * share;
    const auto [r, l] = std::pair(p.motor.resistance_ohm, p.motor.quadrature_inductance_h);
    EXPECT_NEAR(turning.plant.current_a(), -emf_v * h / l * (1.0 - 0.5 * r * h / l), 0.01 * emf_v * h / l);
  }
}

TEST(Heat, AmbientIsFollowed) {
  Parameters p = bare_motor();
  p.thermal.case_heat_capacity_j_per_k = p.thermal.winding_heat_capacity_j_per_k = 0.1;
  p.thermal.stage_heat_capacity_j_per_k = 0.1;
  Rig rig(p);
  rig.plant.set_ambient_c(60.0);
  rig.run(48000);
  EXPECT_NEAR(rig.feedback.ambient_temperature_c, 60.0F, 1e-3F);
  EXPECT_NEAR(rig.feedback.encoder_temperature_c, 60.0F, 0.1F);
  EXPECT_NEAR(rig.plant.case_temperature_c(), 60.0, 0.1);
  EXPECT_NEAR(rig.feedback.power_stage_temperature_c, 60.0F, 0.1F);
  EXPECT_THROW(rig.plant.set_ambient_c(200.0), std::invalid_argument);
}

}  // namespace
}  // namespace heat_test
}  // namespace servodrome::plant::test
