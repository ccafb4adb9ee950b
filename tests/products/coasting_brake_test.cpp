#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "rig.hpp"

// A brake that closes only when an axis without power has slowed down.
namespace servodrome {
namespace coasting_brake_test {
namespace {

struct CoastingRig : test::Rig<products::Generic402> {
  explicit CoastingRig(float brake_speed_rpm, std::uint32_t brake_wait_ms, double friction_nm)
      : Rig(plant_of(friction_nm)) {
    drive::Configuration configuration = device.drive().configuration();
    configuration.brake_engage_ms = configuration.brake_release_ms = 20;
    configuration.brake_speed_rpm = brake_speed_rpm;
    configuration.brake_wait_ms = brake_wait_ms;
    device.drive().configure(configuration);
    set(0x6060, 0, 3);
    set(0x6083, 0, 100'000'000);
    set(0x60FF, 0, static_cast<std::int64_t>(1000.0 / 60.0 * device.drive().axis().units.counts_per_revolution));
    EXPECT_TRUE(enable());
    run_ms(400);
    EXPECT_NEAR(plant.velocity_rpm(), 1000.0, 20.0);
  }
  static plant::Parameters plant_of(double friction_nm) {
    plant::Parameters parameters = test::default_plant();
    parameters.motor.brake_torque_nm = 0.0;  // the effect of the brake on the shaft is not tested here
    parameters.load.coulomb_friction_nm = parameters.load.static_friction_nm = friction_nm;
    return parameters;
  }
  // Switches the power off immediately; returns the time until the brake closes, and the speed at that time.
  double brake_closes_after_ms() {
    control(0x00);
    return static_cast<double>(run_until([this] { return !actuation.brake_released; }, 2000)) / 16.0;
  }
};

TEST(CoastingBrake, ClosesWhenTheAxisIsSlow) {
  CoastingRig rig(300.0F, 2000, 0.05);
  const double ms = rig.brake_closes_after_ms();
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_NEAR(std::abs(rig.plant.velocity_rpm()), 300.0, 15.0);
  EXPECT_GT(ms, 5.0);
}

TEST(CoastingBrake, ClosesAfterItsWaitAtTheLatest) {
  CoastingRig rig(300.0F, 50, 0.005);
  EXPECT_NEAR(rig.brake_closes_after_ms(), 50.0, 1.0);
  EXPECT_GT(std::abs(rig.plant.velocity_rpm()), 600.0);
}

TEST(CoastingBrake, DoesNotWaitWithoutASpeed) {
  CoastingRig rig(0.0F, 50, 0.005);
  EXPECT_LE(rig.brake_closes_after_ms(), 1.0);
}

TEST(CoastingBrake, OpensAgainWithPower) {
  CoastingRig rig(300.0F, 2000, 0.005);
  rig.control(0x00);
  rig.run_ms(20);
  EXPECT_TRUE(rig.actuation.brake_released);
  rig.control(0x06);
  rig.run_ms(1);
  rig.control(0x0F);
  rig.run_ms(1);
  rig.control(0x0F);
  EXPECT_EQ(rig.run_until([&rig] { return !rig.actuation.brake_released; }, 300), -1);
}

// The brake is already closing when a load accelerates the axis again: a loss of power must not open it again.
TEST(CoastingBrake, ThatClosesStaysClosed) {
  CoastingRig rig(300.0F, 2000, 0.005);
  rig.control(0x07);
  ASSERT_GE(rig.run_until([&rig] { return !rig.actuation.brake_released; }, 2000), 0);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  rig.plant.set_external_torque_nm(-20.0);
  ASSERT_GE(rig.run_until([&rig] { return std::abs(rig.plant.velocity_rpm()) > 500.0; }, 15), 0);
  rig.run_ms(1);  // until the speed is measured
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  rig.plant.set_external_torque_nm(0.0);
  rig.control(0x00);
  EXPECT_EQ(rig.run_until([&rig] { return rig.actuation.brake_released; }, 100), -1);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
}

// While the brake opens, the drive holds its position. In all modes the bits "cyclic mode follows" and "target reached"
// of the statusword are 0.
TEST(OpeningBrake, NothingIsFollowedOrReachedMeanwhile) {
  constexpr int delay_ms = 80;
  for (const int mode : {1, 2, 3, 4, 6, 7, 8, 9, 10}) {
    test::Rig<products::Generic402> rig;
    rig.set(0x2020, 1, delay_ms);
    rig.set(0x6060, 0, mode);
    rig.run_ms(1);
    rig.control(0x06);
    rig.run_ms(1);
    rig.control(0x07);
    rig.run_ms(200);
    rig.control(mode == 7 ? 0x1F : 0x0F);
    const bool follows = mode >= 7;  // bit 12 is "drive follows" or "interpolation is active"
    for (int ms = 1; ms < delay_ms - 1; ++ms) {
      rig.run_ms(1);
      EXPECT_EQ(rig.status() & (follows ? 0x1400 : 0x0400), 0) << "mode " << mode << ", " << ms;
      EXPECT_FALSE(rig.device.drive().in_motion());
    }
    rig.run_ms(4);
    if (follows) {
      EXPECT_NE(rig.status() & 0x1000, 0) << "mode " << mode;
    }
  }
}

}  // namespace
}  // namespace coasting_brake_test
}  // namespace servodrome
