#include <gtest/gtest.h>

#include "jmc_rig.hpp"

// The brake sequence P01-30 to P01-32 (ch. 8.2.2, Chart 129): the motor has power and the brake is open from Switched
// on.
namespace servodrome {
namespace jmc_brake_test {
namespace {

using drive::PowerState;
using test::JmcRig;

plant::Parameters vertical_axis() {
  plant::Parameters parameters = test::jmc_plant();
  parameters.motor.brake_torque_nm = 1.5;
  parameters.motor.brake_engage_ms = 40.0;
  parameters.motor.brake_release_ms = 40.0;
  return parameters;
}

struct BrakeRig : JmcRig {
  explicit BrakeRig(int delay_ms = 100) : JmcRig(vertical_axis(), test::jmc_settings()) {
    set_panel(1, 30, delay_ms);
    set(0x607F, 0, 400000);
    set(0x60C5, 0, 4000000);
    set(0x60C6, 0, 4000000);
    set(0x6083, 0, 400000);
    set(0x6084, 0, 400000);
    set(0x6060, 0, 3);
    run_ms(350);
    control(0x06);
    run_ms(2);
    EXPECT_FALSE(actuation.brake_released) << "shutdown holds the brake (Table 154)";
    EXPECT_FALSE(actuation.pwm_enabled);
  }
  void turn(std::int64_t rpm) {
    set(0x60FF, 0, rpm * 4000 / 60);
    control(0x0F);
    run_ms(600);
    EXPECT_NEAR(plant.velocity_rpm(), static_cast<double>(rpm), 20.0);
  }
  double ms_until(const std::function<bool()>& condition, double limit_ms = 2000) {
    const std::int64_t ticks = run_until(condition, limit_ms);
    return ticks < 0 ? -1.0 : static_cast<double>(ticks) / 16.0;
  }
};

TEST(JmcBrake, OpensInSwitchedOnAndHoldsTheLoad) {
  BrakeRig rig;
  rig.plant.set_external_torque_nm(0.2);
  rig.control(0x07);
  rig.run_ms(2);
  EXPECT_EQ(rig.status() & 0x6F, 0x23);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  EXPECT_TRUE(rig.actuation.brake_released);
  rig.run_ms(500);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 0.0, 15.0) << "held by the motor";
  const auto rated_nm = static_cast<double>(rig.device.drive().configuration().motor.rated_torque_nm);
  EXPECT_NEAR(static_cast<double>(rig.monitor(10)), 100.0 * 0.2 / rated_nm, 6.0);
}

// The load acts on the motor as soon as the brake opens, and the loops need a deviation to build up torque: the load
// sags. P02-50, the holding torque (ch. 8.2.3), acts before the brake opens.
TEST(JmcBrake, LoadSagsByWhatP0250DoesNotHold) {
  const auto deepest = [](double share) {
    BrakeRig rig;
    const auto rated_nm = static_cast<double>(rig.device.drive().configuration().motor.rated_torque_nm);
    const double load_nm = 0.2;
    rig.set_panel(2, 50, std::lround(1000.0 * share * load_nm / rated_nm));
    rig.plant.set_external_torque_nm(load_nm);
    rig.run_ms(20);
    rig.control(0x07);
    std::int64_t least = 0;
    for (int ms = 0; ms < 500; ++ms) {
      rig.run_ms(1);
      least = std::min(least, rig.plant.position_counts());
    }
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 0.0, 3.0) << "held in the end";
    return static_cast<double>(least);
  };
  const double bare = deepest(0.0);
  EXPECT_LT(bare, -10.0);
  EXPECT_NEAR(deepest(0.5), 0.5 * bare, 0.15 * -bare);
  EXPECT_GE(deepest(1.0), -3.0);
}

// Commands act after the time P01-30 from power to the motor (ch. 8.2.2).
TEST(JmcBrake, CommandsWaitForItsDelay) {
  for (const int delay_ms : {0, 100, 255}) {
    BrakeRig rig(delay_ms);
    rig.set(0x60FF, 0, 40000);
    rig.control(0x07);
    rig.control(0x0F);
    const double ms = rig.ms_until([&] { return rig.device.drive().in_motion(); });
    EXPECT_NEAR(ms, delay_ms, 2.0) << delay_ms;
  }
}

// P01-30 counts from the command that opens the brake: the time in Switched on is included.
TEST(JmcBrake, DelayCountsFromSwitchedOn) {
  for (const int dwell_ms : {0, 40, 90, 300}) {
    BrakeRig rig;
    rig.set(0x60FF, 0, 40000);
    rig.control(0x07);
    rig.run_ms(dwell_ms);
    rig.control(0x0F);
    EXPECT_NEAR(rig.ms_until([&] { return rig.device.drive().in_motion(); }), std::max(0, 100 - dwell_ms), 2.0)
        << dwell_ms;
  }
}

// Bit 12 is set exactly in the cycles in which the drive follows 607Ah; bit 10 is not set before.
TEST(JmcBrake, StatuswordSaysFromWhenTargetsAreFollowed) {
  for (const int dwell_ms : {0, 40}) {
    BrakeRig rig;
    rig.set(0x6060, 0, 8);
    rig.set(0x60C2, 1, 1);
    rig.set(0x60C2, 2, -3);
    rig.set(0x607A, 0, rig.get(0x6064));
    rig.control(0x07);
    rig.run_ms(dwell_ms);
    rig.control(0x0F);
    const std::int64_t start = rig.get(0x6064);
    int followed_from = -1;
    for (int ms = 0; ms < 200; ++ms) {
      const bool follows = (rig.status() & 0x1000) != 0;
      if (follows && followed_from < 0) followed_from = ms;
      if (followed_from >= 0) {
        EXPECT_TRUE(follows) << "lost at " << ms;
        rig.set(0x607A, 0, start + 2 * (ms - followed_from + 1));  // a master that waits for bit 12 loses no motion
      } else {
        EXPECT_EQ(rig.status() & 0x0400, 0) << "target reached at " << ms;
        EXPECT_FALSE(rig.device.drive().in_motion()) << ms;
      }
      rig.run_ms(1);
    }
    EXPECT_NEAR(followed_from, 100 - dwell_ms, 2);
    const drive::Axis& axis = rig.device.drive().axis();
    EXPECT_NEAR(static_cast<double>(axis.units.to_user(axis.generator.nearest_position()) - start),
                2.0 * (200 - followed_from), 4.0);
  }
}

// Enabled again while the brake closes: the brake opens again, and the delay starts again. While it closes, the drive
// does not follow targets.
TEST(JmcBrake, DelayCountsAnewWhenEnabledWhileItCloses) {
  BrakeRig rig;
  rig.set(0x6060, 0, 8);
  rig.set(0x605C, 0, 0);
  rig.control(0x07);
  rig.run_ms(150);
  rig.control(0x0F);
  rig.run_ms(5);
  EXPECT_NE(rig.status() & 0x1000, 0);
  rig.control(0x06);
  for (int ms = 0; ms < 30; ++ms) {
    rig.run_ms(1);
    EXPECT_EQ(rig.status() & 0x1000, 0) << ms;
  }
  EXPECT_FALSE(rig.actuation.brake_released);
  rig.control(0x0F);
  EXPECT_NEAR(rig.ms_until([&] { return (rig.status() & 0x1000) != 0; }), 100.0, 2.0);
  EXPECT_EQ(rig.status() & 0x6F, 0x27);
}

// The quick stop in Switched on and disable voltage end in Switch on disabled, also while the brake still closes: no
// later command takes them back.
TEST(JmcBrake, ClosesAfterAQuickStopInSwitchedOn) {
  for (const int word : {0x02, 0x00}) {
    for (const int later : {0x06, 0x07, 0x0F}) {
      SCOPED_TRACE(testing::Message() << word << ", then " << later);
      BrakeRig rig;
      rig.set(0x605A, 0, 0);
      rig.control(0x07);
      rig.run_ms(500);
      ASSERT_EQ(rig.status() & 0x6F, 0x23);
      rig.control(static_cast<std::uint16_t>(word));
      rig.run_ms(10);
      rig.control(static_cast<std::uint16_t>(later));
      EXPECT_GE(rig.ms_until([&] { return !rig.actuation.pwm_enabled; }), 50.0);
      EXPECT_EQ(rig.status() & 0x6F, 0x40);
      EXPECT_FALSE(rig.actuation.brake_released);
    }
  }
}

// At rest: the brake closes first, the motor is switched off after P01-30.
TEST(JmcBrake, ClosesBeforePowerOffAtRest) {
  for (const int delay_ms : {50, 200}) {
    BrakeRig rig(delay_ms);
    rig.plant.set_external_torque_nm(0.2);
    rig.control(0x0F);
    rig.control(0x07);
    rig.run_ms(500);
    rig.control(0x06);
    rig.run_ms(2);
    EXPECT_FALSE(rig.actuation.brake_released);
    EXPECT_TRUE(rig.actuation.pwm_enabled);
    EXPECT_NEAR(rig.ms_until([&] { return !rig.actuation.pwm_enabled; }), delay_ms - 2, 2.0);
    rig.run_ms(200);
    EXPECT_EQ(rig.status() & 0x6F, 0x21);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 0.0, 30.0) << "nothing falls";
  }
}

// In motion: the motor is switched off immediately; the brake closes when the axis is slower than P01-31 ...
TEST(JmcBrake, WaitsForASlowAxis) {
  BrakeRig rig;
  rig.set_panel(1, 31, 300);
  rig.set_panel(1, 32, 255);
  rig.plant.set_coulomb_friction_nm(0.05);
  rig.control(0x07);
  rig.run_ms(150);
  rig.turn(900);
  rig.control(0x00);
  rig.run_ms(1);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_TRUE(rig.actuation.brake_released);
  const double ms = rig.ms_until([&] { return !rig.actuation.brake_released; });
  EXPECT_LT(ms, 150.0);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 300.0, 30.0);
}

// ... and at the latest after P01-32.
TEST(JmcBrake, WaitsNoLongerThanItsLimit) {
  BrakeRig rig;
  rig.set_panel(1, 31, 50);
  rig.set_panel(1, 32, 40);
  rig.control(0x07);
  rig.run_ms(150);
  rig.turn(900);
  rig.control(0x00);
  const double ms = rig.ms_until([&] { return !rig.actuation.brake_released; });
  EXPECT_NEAR(ms, 40.0, 2.0);
  EXPECT_GT(rig.plant.velocity_rpm(), 300.0);
  rig.run_ms(300);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.1) << "the brake stops it";
}

// 60FEh bit 0 controls the brake directly if its mask bit is set (Table 216).
TEST(JmcBrake, BySixtyFe) {
  BrakeRig rig;
  rig.control(0x07);
  rig.run_ms(150);
  EXPECT_TRUE(rig.actuation.brake_released);
  rig.set(0x60FE, 1, 1);
  rig.run_ms(2);
  EXPECT_TRUE(rig.actuation.brake_released) << "not enabled";
  rig.set(0x60FE, 2, 1);
  rig.run_ms(2);
  EXPECT_FALSE(rig.actuation.brake_released);
  rig.set(0x60FE, 1, 0);
  rig.run_ms(2);
  EXPECT_TRUE(rig.actuation.brake_released);
}

}  // namespace
}  // namespace jmc_brake_test
}  // namespace servodrome
