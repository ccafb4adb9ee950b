#include <gtest/gtest.h>

#include "jmc_rig.hpp"

// The two gain sets and the modes of P02-30 (Table 65, ch. 8.2.3).
namespace servodrome {
namespace jmc_gain_switching_test {
namespace {

using products::jmc_ec::GainSwitching;
using products::jmc_ec::SwitchingMode;
using test::FactoryJmcRig;

// Cycles until the set changes; -1: it does not.
int cycles_until(GainSwitching& switching, std::size_t set, const GainSwitching::Settings& settings,
                 const GainSwitching::Inputs& inputs, int most = 1000) {
  for (int n = 0; n < most; ++n) {
    switching.update(settings, inputs);
    if (switching.set() == set) return n;
  }
  return -1;
}

GainSwitching::Inputs large(SwitchingMode mode, double value) {
  GainSwitching::Inputs inputs{.positioned = true};
  switch (mode) {
    case SwitchingMode::torque_command: inputs.torque_command = value; break;
    case SwitchingMode::speed_command: inputs.speed_command = -value; break;
    case SwitchingMode::position_deviation: inputs.position_deviation = value; break;
    case SwitchingMode::actual_speed: inputs.actual_speed = value; break;
    default: break;
  }
  return inputs;
}

TEST(JmcGainSwitching, LevelHysteresisAndDelay) {
  for (const SwitchingMode mode : {SwitchingMode::torque_command, SwitchingMode::speed_command,
                                   SwitchingMode::position_deviation, SwitchingMode::actual_speed}) {
    SCOPED_TRACE(static_cast<int>(mode));
    const GainSwitching::Settings settings{.mode = mode, .level = 800, .hysteresis = 100, .delay_cycles = 20};
    GainSwitching switching;
    EXPECT_EQ(cycles_until(switching, 1, settings, large(mode, 900)), -1) << "not beyond level and hysteresis";
    EXPECT_EQ(cycles_until(switching, 1, settings, large(mode, 901)), 0) << "at once";
    EXPECT_EQ(cycles_until(switching, 0, settings, large(mode, 701)), -1) << "within the hysteresis";
    EXPECT_EQ(cycles_until(switching, 0, settings, large(mode, 700), 15), -1);
    EXPECT_EQ(cycles_until(switching, 0, settings, large(mode, 750), 15), -1) << "the delay begins anew";
    EXPECT_EQ(cycles_until(switching, 0, settings, large(mode, 700)), 20) << "after the delay";
    // Other inputs have no effect.
    GainSwitching::Inputs others{.torque_command = 5000,
                                 .speed_command = 5000,
                                 .position_deviation = 5000,
                                 .actual_speed = 5000,
                                 .position_command = true};
    const GainSwitching::Inputs own = large(mode, 0);
    if (mode == SwitchingMode::torque_command) others.torque_command = own.torque_command;
    if (mode == SwitchingMode::speed_command) others.speed_command = own.speed_command;
    if (mode == SwitchingMode::position_deviation) others.position_deviation = own.position_deviation;
    if (mode == SwitchingMode::actual_speed) others.actual_speed = own.actual_speed;
    EXPECT_EQ(cycles_until(switching, 1, settings, others), -1);
  }
}

// A hysteresis larger than the level ends at 0; otherwise the first set would never return.
TEST(JmcGainSwitching, HysteresisIsNoLargerThanTheLevel) {
  const GainSwitching::Settings settings{.mode = SwitchingMode::actual_speed, .level = 100, .hysteresis = 500};
  GainSwitching switching;
  EXPECT_EQ(cycles_until(switching, 1, settings, {.actual_speed = 201}), 0);
  EXPECT_EQ(cycles_until(switching, 0, settings, {.actual_speed = 1}), -1);
  EXPECT_EQ(cycles_until(switching, 0, settings, {.actual_speed = 0}), 0);
}

TEST(JmcGainSwitching, ModesWithoutALevel) {
  GainSwitching switching;
  GainSwitching::Settings settings{.level = 100, .delay_cycles = 20};
  const auto with = [&settings](SwitchingMode mode) {
    settings.mode = mode;
    return settings;
  };
  // 0, 1, 2: selected, without delay.
  EXPECT_EQ(cycles_until(switching, 1, with(SwitchingMode::first), {.input = true, .position_command = true}), -1);
  EXPECT_EQ(cycles_until(switching, 1, with(SwitchingMode::second), {}), 0);
  EXPECT_EQ(cycles_until(switching, 0, with(SwitchingMode::first), {}), 0);
  EXPECT_EQ(cycles_until(switching, 1, with(SwitchingMode::input), {.input = true}), 0);
  EXPECT_EQ(cycles_until(switching, 0, with(SwitchingMode::input), {}), 0);
  // 7: while there is a command.
  EXPECT_EQ(cycles_until(switching, 1, with(SwitchingMode::position_command), {.position_command = true}), 0);
  EXPECT_EQ(cycles_until(switching, 0, with(SwitchingMode::position_command), {}), 20);
  // 8: until the axis is in position.
  EXPECT_EQ(cycles_until(switching, 1, with(SwitchingMode::positioning_incomplete), {.positioned = false}), 0);
  EXPECT_EQ(cycles_until(switching, 0, with(SwitchingMode::positioning_incomplete), {.positioned = true}), 20);
  // 10: a command selects the second set; low speed without a command ends it.
  const auto mode_10 = with(SwitchingMode::command_and_speed);
  EXPECT_EQ(cycles_until(switching, 1, mode_10, {.actual_speed = 5000}), -1) << "speed alone does not";
  EXPECT_EQ(cycles_until(switching, 1, mode_10, {.position_command = true}), 0);
  EXPECT_EQ(cycles_until(switching, 0, mode_10, {.actual_speed = 101}), -1);
  EXPECT_EQ(cycles_until(switching, 0, mode_10, {.actual_speed = 99}), 20);
}

// 4: the speed command's change within 10 ms.
TEST(JmcGainSwitching, ChangeOfTheSpeedCommand) {
  const GainSwitching::Settings settings{.mode = SwitchingMode::speed_command_change, .level = 100, .hysteresis = 10};
  for (const double per_cycle : {5.4, 5.6}) {  // 108 and 112 in 20 cycles
    GainSwitching switching;
    double command = 0.0;
    bool second = false;
    for (int n = 0; n < 200; ++n) {
      switching.update(settings, {.speed_command = command});
      command += per_cycle;
      second |= switching.set() == 1;
    }
    EXPECT_EQ(second, per_cycle > 5.5);
  }
}

TEST(JmcGainSwitching, PositionGainChangesSmoothly) {
  GainSwitching switching;
  const GainSwitching::Settings second{.mode = SwitchingMode::second, .blend_cycles = 40};
  for (int n = 1; n <= 40; ++n) {
    EXPECT_TRUE(switching.update(second, {}));
    EXPECT_NEAR(switching.blend(), n / 40.0, 1e-9);
  }
  EXPECT_FALSE(switching.update(second, {})) << "nothing changes any more";
}

// --- On the axis

struct SwitchingRig : FactoryJmcRig {
  explicit SwitchingRig(int mode) {
    set_panel(1, 2, 0);
    set_panel(1, 4, 0);
    set_panel(2, 30, mode);
    set_panel(2, 33, 200);  // 20 ms
    set_panel(2, 34, 100);  // 10 ms
    set(0x607F, 0, 400000);
    set(0x6060, 0, 1);
    set(0x6081, 0, 40000);
    EXPECT_TRUE(enable());
    run_ms(120);
  }
  const drive::Gains& gains() { return device.drive().configuration().gains; }
  bool second() { return device.panel().switching().set() == 1; }
  void start(std::int64_t target) {
    set(0x607A, 0, target);
    control(0x1F);
  }
  double ms_until(const std::function<bool()>& condition) {
    return static_cast<double>(run_until(condition, 3000)) / 16.0;
  }
};

// P02-13 and P02-14 act immediately, P02-01 within P02-34; the first set returns 20 ms after the end of the command.
TEST(JmcGainSwitching, WithTheCommandOnTheAxis) {
  SwitchingRig rig(7);
  EXPECT_FLOAT_EQ(rig.gains().position_kp, 48.0F);
  const float kp = rig.gains().velocity_kp;
  const float ki = rig.gains().velocity_ki;
  EXPECT_NEAR(static_cast<double>(ki), static_cast<double>(kp) / 10e-3, 1e-4 * static_cast<double>(ki));
  rig.set_panel(2, 13, 540);
  rig.start(20000);
  EXPECT_GE(rig.ms_until([&] { return rig.second(); }), 0.0);
  EXPECT_FLOAT_EQ(rig.gains().velocity_kp, 2.0F * kp);
  EXPECT_NEAR(static_cast<double>(rig.gains().velocity_ki), 2.0 * static_cast<double>(kp), 1e-3) << "1000 ms";
  EXPECT_LT(rig.gains().position_kp, 49.0F);
  EXPECT_NEAR(rig.ms_until([&] { return rig.gains().position_kp >= 56.99F; }), 10.0, 1.0);
  ASSERT_GE(rig.ms_until([&] { return !rig.device.drive().in_motion(); }), 100.0);
  EXPECT_NEAR(rig.ms_until([&] { return !rig.second(); }), 20.0, 1.0);
  EXPECT_FLOAT_EQ(rig.gains().velocity_kp, kp);
}

// 131072 per revolution, 200 rpm by 1000, 25 % by 1000 (ch. 8.2.3).
TEST(JmcGainSwitching, UnitsOfTheLevels) {
  SwitchingRig by_speed(9);
  by_speed.set_panel(2, 31, 1000);
  by_speed.set_panel(2, 32, 0);
  by_speed.set(0x6083, 0, 100000);
  by_speed.start(100000);
  ASSERT_GE(by_speed.ms_until([&] { return by_speed.second(); }), 0.0);
  EXPECT_NEAR(std::abs(by_speed.plant.velocity_rpm()), 200.0, 15.0);

  SwitchingRig by_deviation(6);
  by_deviation.set_panel(2, 31, 3277);  // 100 counts of 4000
  by_deviation.set_panel(2, 32, 0);
  by_deviation.start(100000);
  ASSERT_GE(by_deviation.ms_until([&] { return by_deviation.second(); }), 0.0);
  EXPECT_NEAR(static_cast<double>(by_deviation.monitor(5)), 100.0, 8.0);

  SwitchingRig by_torque(3);
  by_torque.set_panel(2, 31, 2000);  // 50 %
  by_torque.set_panel(2, 32, 0);
  const auto rated = static_cast<double>(by_torque.device.drive().configuration().motor.rated_torque_nm);
  by_torque.plant.set_external_torque_nm(0.4 * rated);
  by_torque.run_ms(300);
  EXPECT_FALSE(by_torque.second());
  by_torque.plant.set_external_torque_nm(0.6 * rated);
  by_torque.run_ms(300);
  EXPECT_TRUE(by_torque.second());
}

TEST(JmcGainSwitching, UntilItIsInPosition) {
  SwitchingRig rig(8);
  rig.run_ms(50);
  EXPECT_FALSE(rig.second());
  rig.start(4000);
  rig.run_ms(5);
  EXPECT_TRUE(rig.second());
  ASSERT_GE(rig.ms_until([&] { return rig.device.panel().in_position(); }), 0.0);
  EXPECT_TRUE(rig.second());
  rig.run_ms(25);
  EXPECT_FALSE(rig.second());
}

}  // namespace
}  // namespace jmc_gain_switching_test
}  // namespace servodrome
