#include "plant/power_stage.hpp"

#include <cmath>
#include <gtest/gtest.h>

#include "rig.hpp"

// The voltages that a power stage outputs for the commanded ones, alone and with the windings.
namespace servodrome::plant {
namespace power_stage_test {
namespace {

using Phases = std::array<float, 3>;

constexpr double range_a = 20.0;
constexpr double link_v = 300.0;

Stage lossless() {
  Stage stage;
  stage.ideal = false;
  stage.delay_ticks = 0;
  stage.dead_time_us = 0.0;
  stage.switch_drop_v = 0.0;
  stage.modulation_limit = 1.0;
  return stage;
}

drive::Actuation driven(const Phases& volts) {
  drive::Actuation actuation;
  actuation.pwm_enabled = true;
  actuation.phase_voltage_v = volts;
  return actuation;
}

TEST(PowerStage, AnswersAsManyTicksLateAsItIsTold) {
  for (int delay = 0; delay <= 3; ++delay) {
    Stage settings = lossless();
    settings.delay_ticks = delay;
    PowerStage stage(settings, 3, range_a);
    for (int tick = 1; tick <= 10; ++tick) {
      const auto volts = static_cast<float>(tick);
      const Phases acting = stage.apply(driven({volts, -volts, 0.0F}), {}, link_v).phase_voltage_v;
      EXPECT_EQ(acting[0], static_cast<float>(std::max(0, tick - delay))) << delay;
      EXPECT_EQ(acting[1], -acting[0]);
    }
    // The switches open immediately, and delayed voltages are discarded.
    drive::Actuation off = driven({10.0F, 0.0F, 0.0F});
    off.pwm_enabled = false;
    EXPECT_FALSE(stage.apply(off, {}, link_v).pwm_enabled);
    EXPECT_EQ(stage.apply(driven({7.0F, 0.0F, 0.0F}), {}, link_v).phase_voltage_v[0], delay == 0 ? 7.0F : 0.0F);
  }
}

// 2 us of 62.5 us at 300 V are 9.6 V against the current; 3/4 of it is compensated.
TEST(PowerStage, LosesItsDeadTimeAndTheDropAgainstTheCurrent) {
  Stage settings = lossless();
  settings.dead_time_us = 2.0;
  settings.dead_time_compensation = 0.75;
  settings.switch_drop_v = 1.5;
  PowerStage star(settings, 3, range_a);
  const Phases acting = star.apply(driven({50.0F, 0.0F, -50.0F}), {5.0F, -2.0F, 0.1F}, link_v).phase_voltage_v;
  const double lost = 2.0 / 62.5 * 300.0 * 0.25 + 1.5;
  EXPECT_NEAR(static_cast<double>(acting[0]), 50.0 - lost, 1e-4);
  EXPECT_NEAR(static_cast<double>(acting[1]), lost, 1e-4);
  EXPECT_NEAR(static_cast<double>(acting[2]), -50.0 - 0.5 * lost, 1e-4) << "half of 1 % of the range: half of it";
  EXPECT_NEAR(star.loss_w(), 1.5 * (5.0 + 2.0 + 0.05), 1e-6);

  PowerStage quadrature(settings, 2, range_a);  // two half bridges in series with each winding
  const Phases windings = quadrature.apply(driven({50.0F, -20.0F, 0.0F}), {5.0F, -2.0F, 0.0F}, link_v).phase_voltage_v;
  EXPECT_NEAR(static_cast<double>(windings[0]), 50.0 - 2.0 * lost, 1e-4);
  EXPECT_NEAR(static_cast<double>(windings[1]), -20.0 + 2.0 * lost, 1e-4);
}

TEST(PowerStage, ReachesAShareOfTheDcLink) {
  Stage settings = lossless();
  settings.modulation_limit = 0.9;
  PowerStage star(settings, 3, range_a);
  const Phases acting = star.apply(driven({200.0F, -100.0F, -100.0F}), {}, link_v).phase_voltage_v;
  EXPECT_NEAR(static_cast<double>(acting[0] - acting[1]), 0.9 * link_v, 1e-3);
  EXPECT_NEAR(static_cast<double>(acting[0]), 180.0, 1e-3) << "the angle stays";
  const Phases within = star.apply(driven({100.0F, -50.0F, -50.0F}), {}, link_v).phase_voltage_v;
  EXPECT_EQ(within[0], 100.0F);
  PowerStage quadrature(settings, 2, range_a);
  EXPECT_NEAR(static_cast<double>(quadrature.apply(driven({290.0F, -290.0F, 0.0F}), {}, link_v).phase_voltage_v[1]),
              -270.0, 1e-3);
}

// A constant direct current: the loss in the switches comes from the DC link and is counted.
TEST(PowerStage, TakesItsLossOutOfTheDcLink) {
  Parameters p = test::bare_motor();
  p.stage = lossless();
  p.stage.switch_drop_v = 2.0;
  p.supply.bleeder_resistance_ohm = 1.0e9;
  p.thermal.stage_resistance_ohm = p.thermal.stage_standby_w = 0.0;
  test::Rig rig(p);
  rig.plant.lock_rotor(true);
  rig.actuation.pwm_enabled = true;
  rig.set_voltage(12.0, 0.0);
  rig.run(16000);
  const Energy before = rig.plant.energy();
  rig.run(1600);
  const Energy after = rig.plant.energy();
  const double current = rig.plant.direct_current_a();
  // 2 V against U, and the same along V and W: 4 V / 3 * 2 of the amplitude.
  EXPECT_NEAR(current, (12.0 - 2.0 * 4.0 / 3.0) / p.motor.resistance_ohm, 0.01);
  const double loss_w = 2.0 * 2.0 * current;
  EXPECT_NEAR(after.stage_j - before.stage_j, loss_w * 0.1, 1e-3 * loss_w);
  const double drawn = after.supplied_j - before.supplied_j - (after.link_stored_j - before.link_stored_j);
  EXPECT_NEAR(drawn, after.to_motor_j - before.to_motor_j + after.stage_j - before.stage_j, 1e-3 * drawn);
}

TEST(PowerStage, WithoutImperfectionsIsTheIdealOne) {
  Parameters p = test::bare_motor();
  test::Rig ideal(p);
  p.stage = lossless();
  test::Rig other(p);
  for (int i = 0; i < 2000; ++i) {
    ideal.step_voltage(0.0, 40.0);
    other.actuation = ideal.actuation;
    other.step();
    ASSERT_EQ(ideal.feedback.position_counts, other.feedback.position_counts);
    ASSERT_EQ(ideal.feedback.phase_current_a, other.feedback.phase_current_a);
  }
}

}  // namespace
}  // namespace power_stage_test
}  // namespace servodrome::plant
