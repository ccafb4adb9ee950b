#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "products/pronet/pronet.hpp"

// Limits that are lowered while the axis moves: it slows down by its ramp, and the new limit itself causes no fault.
namespace servodrome {
namespace lowered_limits_test {
namespace {

using drive::PowerState;
using products::Generic402;
using products::Ismc;
using products::Pronet;
using test::IsmkRig;
using test::Rig;

constexpr std::uint16_t max_profile_velocity = 0x607F;
constexpr std::uint16_t max_motor_speed = 0x6080;

template <typename RigType>
const drive::Axis& axis_of(RigType& rig) {
  return rig.device.drive().axis();
}
template <typename RigType>
std::int64_t user_velocity(RigType& rig, double rpm) {
  const drive::Axis& axis = axis_of(rig);
  return std::llround(rpm / 60.0 * axis.units.counts_per_revolution / axis.units.velocity);
}
template <typename RigType>
std::int64_t user_ramp(RigType& rig, double rpm_per_s) {
  const drive::Axis& axis = axis_of(rig);
  return std::llround(rpm_per_s / 60.0 * axis.units.counts_per_revolution / axis.units.acceleration);
}

// With ramps of this slope, and limits that allow `fast`.
constexpr double fast_rpm = 1500.0;
constexpr double slow_rpm = 600.0;
constexpr double ramp_rpm_per_s = 6000.0;
template <typename RigType>
void enable_with_ramps(RigType& rig, std::int8_t mode) {
  rig.set(0x6060, 0, mode);
  for (const std::uint16_t ramp : std::to_array<std::uint16_t>({0x6083, 0x6084})) {
    ASSERT_EQ(rig.set(ramp, 0, user_ramp(rig, ramp_rpm_per_s)), dictionary::AbortCode::none);
  }
  rig.set(0x6081, 0, user_velocity(rig, fast_rpm));
  ASSERT_TRUE(rig.enable());
}
template <typename RigType>
bool lower(RigType& rig, std::uint16_t limit) {
  const std::int64_t value =
      limit == max_motor_speed ? static_cast<std::int64_t>(slow_rpm) : user_velocity(rig, slow_rpm);
  return rig.set(limit, 0, value) == dictionary::AbortCode::none;
}
// The shaft slows down to the lower limit by the ramp, without a step and without a fault.
template <typename RigType>
void slows_down(RigType& rig) {
  constexpr double ramp_ms = 1000.0 * (fast_rpm - slow_rpm) / ramp_rpm_per_s;
  double steepest = 0.0;
  double before = std::abs(rig.plant.velocity_rpm());
  ASSERT_NEAR(before, fast_rpm, 0.03 * fast_rpm);
  for (int i = 0; i < static_cast<int>(ramp_ms) + 60; i += 5) {
    rig.run_ms(5);
    const double now = std::abs(rig.plant.velocity_rpm());
    steepest = std::max(steepest, before - now);
    before = now;
    ASSERT_EQ(rig.device.drive().state(), PowerState::operation_enabled)
        << std::hex << rig.get(0x603F) << " after " << std::dec << i << " ms";
  }
  EXPECT_LT(steepest, 1.6 * 0.005 * ramp_rpm_per_s);
  EXPECT_NEAR(before, slow_rpm, 0.05 * slow_rpm);
  rig.run_ms(100);
  EXPECT_NEAR(std::abs(rig.plant.velocity_rpm()), slow_rpm, 0.03 * slow_rpm);
}

template <typename RigType>
void profile_position(RigType& rig, std::uint16_t limit) {
  SCOPED_TRACE(limit);
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 1));
  const auto turns = static_cast<double>(axis_of(rig).units.counts_per_revolution);
  const std::int64_t target = axis_of(rig).units.to_user(std::llround(30.0 * turns));
  rig.set(0x607A, 0, target);
  rig.run_ms(2);
  rig.control(0x1F);
  rig.run_ms(500);
  if (!lower(rig, limit)) return;
  ASSERT_NO_FATAL_FAILURE(slows_down(rig));
  rig.run_ms(3500);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), static_cast<double>(target), 0.01 * static_cast<double>(target));
}
template <typename RigType>
void profile_velocity(RigType& rig, std::uint16_t limit) {
  SCOPED_TRACE(limit);
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 3));
  rig.set(0x60FF, 0, user_velocity(rig, fast_rpm));
  rig.run_ms(500);
  if (!lower(rig, limit)) return;
  slows_down(rig);
}

template <typename Check>
void each_product(const Check& check) {
  for (const std::uint16_t limit : {max_profile_velocity, max_motor_speed}) {
    {
      SCOPED_TRACE("generic402");
      Rig<Generic402> rig;
      check(rig, limit);
    }
    {
      SCOPED_TRACE("ismc");
      Rig<Ismc> rig;
      check(rig, limit);
    }
    {
      SCOPED_TRACE("pronet");
      Rig<Pronet> rig;
      check(rig, limit);
    }
    {
      SCOPED_TRACE("ismk");
      IsmkRig rig;
      check(rig, limit);
    }
  }
}

TEST(LoweredSpeedLimit, ProfilePositionSlowsDown) {
  each_product([](auto& rig, std::uint16_t limit) { profile_position(rig, limit); });
}
TEST(LoweredSpeedLimit, ProfileVelocitySlowsDown) {
  each_product([](auto& rig, std::uint16_t limit) { profile_velocity(rig, limit); });
}
TEST(LoweredSpeedLimit, RaisedAgainTheMoveGoesOnAsItWas) {
  Rig<Generic402> rig;
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 1));
  rig.set(0x607A, 0, 131072 * 60);
  rig.run_ms(2);
  rig.control(0x1F);
  rig.run_ms(500);
  ASSERT_TRUE(lower(rig, max_motor_speed));
  ASSERT_NO_FATAL_FAILURE(slows_down(rig));
  rig.set(max_motor_speed, 0, 6000);
  rig.run_ms(300);
  EXPECT_NEAR(rig.plant.velocity_rpm(), fast_rpm, 0.03 * fast_rpm);
}
// A motion that has passed its target continues with its end velocity 6082h, which also decreases to the limit.
TEST(LoweredSpeedLimit, TheEndVelocitySlowsDown) {
  for (const double direction : {1.0, -1.0}) {
    Rig<Generic402> rig;
    ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 1));
    rig.set(0x6082, 0, user_velocity(rig, fast_rpm));
    rig.set(0x607A, 0, std::llround(direction * 10.0 * axis_of(rig).units.counts_per_revolution));
    rig.run_ms(2);
    rig.control(0x1F);
    rig.run_ms(900);
    ASSERT_TRUE(axis_of(rig).generator.finished());
    ASSERT_NEAR(direction * rig.plant.velocity_rpm(), fast_rpm, 0.03 * fast_rpm);
    ASSERT_TRUE(lower(rig, max_profile_velocity));
    ASSERT_NO_FATAL_FAILURE(slows_down(rig));
    EXPECT_GT(direction * rig.plant.velocity_rpm(), 0.0);
    ASSERT_EQ(rig.set(max_profile_velocity, 0, 0), dictionary::AbortCode::none);  // no limit
    rig.run_ms(400);
    EXPECT_NEAR(direction * rig.plant.velocity_rpm(), fast_rpm, 0.03 * fast_rpm);
  }
}

TEST(LoweredSpeedLimit, CyclicVelocitySlowsDown) {
  Rig<Generic402> rig;
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 9));
  rig.set(0x60FF, 0, user_velocity(rig, fast_rpm));
  rig.run_ms(500);
  ASSERT_TRUE(lower(rig, max_motor_speed));
  slows_down(rig);
}
TEST(LoweredSpeedLimit, HomingSlowsDown) {
  Rig<Generic402> rig;
  rig.set(0x6098, 0, 17);
  rig.set(0x6099, 1, user_velocity(rig, fast_rpm));
  rig.set(0x609A, 0, user_ramp(rig, ramp_rpm_per_s));
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 6));
  rig.control(0x1F);
  rig.run_ms(500);
  ASSERT_TRUE(lower(rig, max_motor_speed));
  slows_down(rig);
}
// Cyclic targets that are now too fast: the axis lags behind them by its ramp.
TEST(LoweredSpeedLimit, CyclicPositionSlowsDown) {
  Rig<Generic402> rig;
  rig.set(0x6065, 0, 0xFFFFFFFF);
  rig.set(0x60C2, 1, 1);
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 8));
  const double step = fast_rpm / 60000.0 * 131072.0;
  double target = 0.0;
  const auto stream = [&](int milliseconds, double by) {
    for (int i = 0; i < milliseconds; ++i) {
      rig.set(0x607A, 0, std::llround(target += by));
      rig.run_ms(1);
    }
  };
  for (int i = 0; i < 200; ++i) stream(1, step * i / 200.0);
  stream(200, step);
  ASSERT_NEAR(rig.plant.velocity_rpm(), fast_rpm, 0.03 * fast_rpm);
  ASSERT_TRUE(lower(rig, max_motor_speed));
  double steepest = 0.0;
  double before = rig.plant.velocity_rpm();
  for (int i = 0; i < 200; i += 5) {
    stream(5, step);
    steepest = std::max(steepest, before - rig.plant.velocity_rpm());
    before = rig.plant.velocity_rpm();
    ASSERT_EQ(rig.device.drive().state(), PowerState::operation_enabled) << std::hex << rig.get(0x603F);
  }
  EXPECT_LT(steepest, 1.6 * 0.005 * ramp_rpm_per_s);
  EXPECT_NEAR(rig.plant.velocity_rpm(), slow_rpm, 0.03 * slow_rpm);
}

// The monitor uses the lower limit after the shaft has been below it.
TEST(LoweredSpeedLimit, IsWatchedOnceTheShaftIsBelowIt) {
  Rig<Generic402> rig;
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 3));
  rig.set(0x60FF, 0, user_velocity(rig, fast_rpm));
  rig.run_ms(500);
  ASSERT_TRUE(lower(rig, max_motor_speed));
  ASSERT_NO_FATAL_FAILURE(slows_down(rig));
  rig.plant.set_external_torque_nm(-4.5);  // accelerates the shaft
  ASSERT_GE(rig.run_until([&] { return rig.get(0x603F) != 0; }, 1000), 0);
  EXPECT_EQ(rig.get(0x603F), 0x8400);
  EXPECT_LT(std::abs(rig.plant.velocity_rpm()), fast_rpm) << "sooner than without the lower limit";
}

// --- Stops at the current limit

// At high speed the voltage of the DC link, not the peak current, limits braking: at higher speeds the motor drives a
// current to which the comparators respond.
TEST(CurrentLimitStop, ReferenceDriveFromEverySpeed) {
  for (const double supply_share : {0.7, 0.85, 1.0}) {
    for (const double inertia_share : {0.2, 1.0, 3.0}) {
      for (const double speed_rpm : {500.0, 3000.0, -4500.0, 5900.0}) {
        SCOPED_TRACE(::testing::Message()
                     << speed_rpm << " rpm, " << supply_share << " of the supply, " << inertia_share << " of the load");
        plant::Parameters parameters = test::default_plant();
        parameters.supply.volts *= supply_share;
        parameters.load.inertia_kgm2 *= inertia_share;
        Rig<Generic402> rig(parameters);
        rig.set(0x605A, 0, 3);
        rig.set(0x6060, 0, 3);
        rig.set(0x6083, 0, user_ramp(rig, 30000.0));
        ASSERT_TRUE(rig.enable());
        rig.set(0x60FF, 0, user_velocity(rig, speed_rpm));
        rig.run_ms(1500);
        ASSERT_GT(std::abs(rig.plant.velocity_rpm()), 0.85 * std::abs(speed_rpm));
        rig.control(0x02);
        const auto ended = [&rig] { return rig.device.drive().state() != PowerState::quick_stop_active; };
        rig.run_ms(1);
        ASSERT_GE(rig.run_until(ended, 2000), 0);
        EXPECT_EQ(rig.get(0x603F), 0) << std::hex << rig.get(0x603F);
        EXPECT_EQ(rig.device.drive().state(), PowerState::switch_on_disabled);
        EXPECT_LT(std::abs(rig.plant.velocity_rpm()), 10.0);
      }
    }
  }
}

// The speed limits of torque modes, and a limit of the drive's own.
template <typename RigType>
void torque_mode(RigType& rig) {
  rig.plant.set_external_torque_nm(0.0);
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 4));
  rig.set(0x6087, 0, 10000);
  rig.set(0x6071, 0, 200);
  rig.run_ms(1500);
}
TEST(LoweredSpeedLimit, TorqueModeOfTheIsmkSlowsDown) {  // 607Fh (ch. 5.2.1.4)
  IsmkRig rig;
  rig.set(max_profile_velocity, 0, user_velocity(rig, fast_rpm));
  ASSERT_NO_FATAL_FAILURE(torque_mode(rig));
  ASSERT_TRUE(lower(rig, max_profile_velocity));
  slows_down(rig);
}
TEST(LoweredSpeedLimit, TorqueModeOfTheIsmcSlowsDown) {  // 2115h
  Rig<Ismc> rig;
  const double rated = static_cast<double>(rig.device.drive().configuration().motor.rated_speed_rpm);
  ASSERT_EQ(rig.set(0x2115, 0, std::llround(1000.0 * fast_rpm / rated)), dictionary::AbortCode::none);
  ASSERT_NO_FATAL_FAILURE(torque_mode(rig));
  ASSERT_EQ(rig.set(0x2115, 0, std::llround(1000.0 * slow_rpm / rated)), dictionary::AbortCode::none);
  slows_down(rig);
}
TEST(LoweredSpeedLimit, OfTheJmcsPanelSlowsDown) {  // P04-06
  test::JmcRig rig;
  rig.open_limits();
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 3));
  rig.set(0x60FF, 0, user_velocity(rig, fast_rpm));
  rig.run_ms(1000);
  ASSERT_EQ(rig.set_panel(4, 6, static_cast<std::int64_t>(slow_rpm)), dictionary::AbortCode::none);
  slows_down(rig);
}

// A halt stops the axis sooner than the limit would have fallen; its end does not let the axis exceed the limit.
TEST(LoweredSpeedLimit, OfTheJmcsPanelHoldsAfterAHalt) {
  test::JmcRig rig;
  rig.open_limits();
  ASSERT_NO_FATAL_FAILURE(enable_with_ramps(rig, 3));
  rig.set(0x60FF, 0, user_velocity(rig, fast_rpm));
  rig.run_ms(1000);
  ASSERT_EQ(rig.set_panel(4, 6, static_cast<std::int64_t>(slow_rpm)), dictionary::AbortCode::none);
  rig.control(0x010F);
  rig.run_ms(600);
  ASSERT_LT(std::abs(rig.plant.velocity_rpm()), 5.0);
  rig.control(0x000F);
  double fastest = 0.0;
  for (int i = 0; i < 400; ++i) {
    rig.run_ms(1);
    fastest = std::max(fastest, std::abs(rig.plant.velocity_rpm()));
  }
  EXPECT_NEAR(fastest, slow_rpm, 0.05 * slow_rpm);
}

}  // namespace
}  // namespace lowered_limits_test
}  // namespace servodrome
