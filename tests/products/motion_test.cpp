#include <cmath>
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// Motion of complete drives on their plants: the values of the ISMC manual's examples, and the modes of the reference
// drive.
namespace servodrome {
namespace motion_test {
namespace {

using products::Generic402;
using products::Ismc;
using test::Rig;

constexpr double cycle_ms = 0.5;

TEST(Ismc, BootsIntoSwitchOnDisabled) {
  Rig<Ismc> rig;
  ASSERT_FALSE(rig.sent.empty());
  EXPECT_EQ(rig.sent[0].id, 0x701U);
  EXPECT_EQ(rig.sent[0].length, 1);
  EXPECT_EQ(rig.sent[0].data[0], 0);
  rig.run_ms(1);
  EXPECT_EQ(rig.status() & 0x6F, 0x40);
}

TEST(Ismc, MovesAsItsExamplesCompute) {
  Rig<Ismc> rig;
  rig.set(0x6060, 0, 1);
  rig.set(0x6081, 0, 1000000);
  ASSERT_TRUE(rig.enable());
  const auto move = [&rig](std::int64_t distance) {
    rig.set(0x607A, 0, distance);
    rig.control(0x4F);
    rig.control(0x5F);
    const std::int64_t start = rig.ticks();
    EXPECT_GE(rig.run_until([&] { return !rig.device.drive().in_motion() && rig.ticks() - start > 16; }, 20000), 0);
    return static_cast<double>(rig.ticks() - start) / 16.0;
  };
  const std::int64_t before = rig.get(0x6062);
  EXPECT_NEAR(move(100000), 1000.0 * 2.0 * std::sqrt(100000.0 / 1310720.0), 2 * cycle_ms);
  EXPECT_EQ(rig.get(0x6062) - before, 100000);
  EXPECT_NEAR(move(2000000), 1000.0 * (2000000.0 / 1000000.0 + 1000000.0 / 1310720.0), 2 * cycle_ms);
  EXPECT_EQ(rig.get(0x6062) - before, 2100000);
  rig.run_ms(100);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6064) - before), 2100000, 1.0);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), static_cast<double>(rig.get(0x6064)), 1.0);
}

TEST(Ismc, QuickStopTakesTheComputedTimeAndWay) {
  Rig<Ismc> rig;
  rig.set(0x6060, 0, 3);
  ASSERT_TRUE(rig.enable());
  rig.set(0x60FF, 0, 1000000);
  rig.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(rig.get(0x606C)), 1000000, 5000);
  rig.control(0x0B);
  const std::int64_t start = rig.ticks();
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().state() == drive::PowerState::switch_on_disabled; }, 1000),
            0);
  EXPECT_NEAR(static_cast<double>(rig.ticks() - start) / 16.0, 1000.0 * 1000000.0 / 5242880.0, 2 * cycle_ms);
}

TEST(Generic402, ProfilePositionReachesTheTarget) {
  Rig<Generic402> rig;
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  rig.set(0x607A, 0, 262144);
  rig.control(0x1F);
  rig.run_ms(1);
  EXPECT_NE(rig.status() & 0x1000, 0);
  rig.control(0x0F);
  ASSERT_GE(rig.run_until([&] { return (rig.status() & 0x400) != 0; }, 10000), 0);
  rig.run_ms(50);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), 262144, 1.0);
}

TEST(Generic402, HomesOnThePresentPosition) {
  Rig<Generic402> rig;
  rig.set(0x6060, 0, 6);
  rig.set(0x607C, 0, 1000);
  ASSERT_TRUE(rig.enable());
  rig.control(0x1F);
  ASSERT_GE(rig.run_until([&] { return (rig.status() & 0x1400) == 0x1400; }, 1000), 0);
  EXPECT_EQ(rig.get(0x6064), -1000);
}

TEST(Generic402, TorqueModeAcceleratesAndCyclicVelocityHolds) {
  Rig<Generic402> rig;
  rig.set(0x6060, 0, 4);
  rig.set(0x6087, 0, 10000);
  ASSERT_TRUE(rig.enable());
  rig.set(0x6071, 0, 100);
  rig.run_ms(20);
  EXPECT_NEAR(static_cast<double>(rig.get(0x6077)), 100.0, 5.0);
  EXPECT_GT(rig.get(0x606C), 0);
  rig.set(0x60FF, 0, 500000);
  rig.set(0x6060, 0, 9);
  rig.run_ms(300);
  EXPECT_NEAR(static_cast<double>(rig.get(0x606C)), 500000, 3000);
}

}  // namespace
}  // namespace motion_test
}  // namespace servodrome
