#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "products/ismc/ismc.hpp"
#include "reference_axis.hpp"

// A mode that is entered in motion without a target, and stops from torque control: the axis comes to rest within its
// limits.
namespace servodrome {
namespace idle_modes_test {
namespace {

using test::Reference;

constexpr std::int64_t turn = 131072;

// Turns at 20 turns/s in profile velocity, with a low 6084h and a high 6085h.
struct Turning : Reference {
  Turning() : Reference(3) {
    set(0x6083, 0, 200 * turn);
    set(0x6085, 0, 1000 * turn);
    set(0x60FF, 0, 20 * turn);
    run_ms(200);
    EXPECT_NEAR(turns_per_s(), 20.0, 0.5);
    set(0x6084, 0, 10 * turn);
  }
};

TEST(IdleMode, HomingThatWasNotStartedObeysALimitSwitch) {
  Turning axis;
  axis.set(0x6060, 0, 6);
  axis.run_ms(50);
  axis.plant.force_input(0, true);
  const double met = axis.turns();
  axis.run_ms(3000);
  EXPECT_LT(axis.turns() - met, 20.0 * 20.0 / 2000.0 + 0.1) << "6085h ends it";
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
  EXPECT_TRUE(axis.bit(11));
}

TEST(IdleMode, HomingThatWasNotStartedAndModeZeroObeySoftwareLimits) {
  for (const std::int64_t mode : {6, 0}) {
    SCOPED_TRACE(mode);
    Turning axis;
    const double limit = axis.turns() + 5.0;
    axis.limit_turns(-10.0, limit);
    axis.set(0x6060, 0, mode);
    axis.run_ms(4000);
    EXPECT_LT(axis.turns(), limit + 0.02);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
    EXPECT_TRUE(axis.bit(11));
  }
}

TEST(IdleMode, AStopThatHomingIsEnteredInKeepsToTheLimits) {
  for (const std::int64_t word : {0x10F, 0x07}) {
    SCOPED_TRACE(word);
    Turning axis;
    const double limit = axis.turns() + 5.0;
    axis.limit_turns(-10.0, limit);
    axis.control(static_cast<std::uint16_t>(word));
    axis.run_ms(5);
    axis.set(0x6060, 0, 6);
    axis.run_ms(4000);
    EXPECT_LT(axis.turns(), limit + 0.02);
  }
}

TEST(IdleMode, IsmcFaultsAtASwitchInHomingThatWasNotStarted) {
  test::Rig<products::Ismc> rig;
  rig.set(0x6060, 0, 3);
  rig.set(0x6083, 0, 100 * turn);
  rig.set(0x6084, 0, 10 * turn);
  ASSERT_TRUE(rig.enable());
  rig.set(0x60FF, 0, 20 * turn);
  rig.run_ms(500);
  rig.set(0x6060, 0, 6);
  rig.run_ms(50);
  rig.plant.force_input(1, true);  // DI1: positive limit
  rig.run_ms(20);
  EXPECT_EQ(rig.get(0x603F, 0), 0x8612);
}

// Bit 5 locks the ramp output of vl velocity mode. There is no output before the mode has had a command.
TEST(VelocityMode, HasNothingToLockWhenItIsEntered) {
  for (const std::int64_t from : {3, 4}) {
    SCOPED_TRACE(from);
    Turning axis;
    if (from == 4) {
      axis.set(0x6060, 0, 4);
      axis.set(0x6071, 0, 200);
      axis.run_ms(20);
    }
    const double before = axis.turns_per_s();
    ASSERT_GT(before, 15.0);
    axis.control(0x1F);
    axis.set(0x6060, 0, 2);
    axis.run_ms(20);
    EXPECT_LT(axis.turns_per_s(), before + 0.2);
    axis.run_ms(10000);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
    axis.set(0x6042, 0, 120);
    axis.control(0x7F);
    axis.run_ms(3000);
    EXPECT_NEAR(axis.turns_per_s(), 2.0, 0.05);
    axis.control(0x5F);
    axis.set(0x6042, 0, 0);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 2.0, 0.05) << "its own output is locked";
  }
}

// Even if 6087h allows only a slow change of the torque.
TEST(ProfileTorque, AStopBrakesAtOnce) {
  for (const std::int64_t word : {0x10F, 0x07, 0x0B}) {
    SCOPED_TRACE(word);
    Reference axis(4);
    axis.set(0x6084, 0, 100 * turn);
    axis.set(0x6085, 0, 100 * turn);
    axis.set(0x605C, 0, 1);
    axis.set(0x605A, 0, 1);
    axis.set(0x6071, 0, 200);
    for (int i = 0; i < 4000 && axis.turns_per_s() < 20.0; ++i) axis.run_ms(1);
    ASSERT_GT(axis.turns_per_s(), 15.0);
    axis.set(0x6087, 0, 1);
    const double before = axis.turns_per_s();
    const double place = axis.turns();
    axis.control(static_cast<std::uint16_t>(word));
    double fastest = before;
    for (int i = 0; i < 500; ++i) {
      axis.run_ms(1);
      fastest = std::max(fastest, axis.turns_per_s());
    }
    EXPECT_LT(fastest, before + 0.5);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.05);
    EXPECT_LT(axis.turns() - place, before * before / 200.0 + 0.1 * before);
  }
}

TEST(FaultReset, ItsBitDoesNotHideAHalt) {
  Turning axis;
  axis.set(0x6084, 0, 100 * turn);
  axis.control(0x18F);
  axis.run_ms(500);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.02);
  axis.control(0x0F);
  axis.run_ms(500);
  EXPECT_NEAR(axis.turns_per_s(), 20.0, 0.5) << "the halt is over";
}

// 6064h shows 32 bits of the position: 607Dh limits the shown value.
TEST(SoftwareLimits, BoundWhatTheActualPositionShows) {
  plant::Parameters parameters = test::default_plant();
  parameters.encoder.start_position_counts = (std::int64_t{1} << 32) + 10 * turn;
  Reference axis(1, parameters);
  const double here = axis.turns();
  ASSERT_NEAR(static_cast<double>(axis.get(0x6064, 0)), 10.0 * turn, 10.0);
  axis.set(0x607D, 1, 5 * turn);
  axis.set(0x607D, 2, 15 * turn);
  axis.set(0x607A, 0, 12 * turn);
  axis.control(0x1F);
  axis.run_ms(3000);
  EXPECT_NEAR(axis.turns() - here, 2.0, 0.01);
  axis.control(0x0F);
  axis.set(0x6060, 0, 8);
  axis.set(0x607A, 0, 13 * turn);
  axis.run_ms(3000);
  EXPECT_NEAR(axis.turns() - here, 3.0, 0.01);
  axis.set(0x607A, 0, 20 * turn);
  axis.run_ms(3000);
  EXPECT_NEAR(axis.turns() - here, 5.0, 0.01);
  axis.set(0x6060, 0, 3);
  axis.set(0x60FF, 0, -2 * turn);
  axis.run_ms(8000);
  EXPECT_NEAR(axis.turns() - here, -5.0, 0.05);
}

// With a range 607Bh as without: a motion that leads to a limit and back reverses before the limit.
TEST(SoftwareLimits, InARangeAreNotPassedByASetPointUnderWay) {
  Reference axis(1);
  axis.set(0x6081, 0, 20 * turn);
  axis.set(0x6083, 0, 100 * turn);
  axis.set(0x6084, 0, 100 * turn);
  axis.set(0x6085, 0, 1000 * turn);
  axis.set(0x607B, 1, -20 * turn);
  axis.set(0x607B, 2, 20 * turn);
  axis.limit_turns(-5.0, 5.0);
  axis.set(0x607A, 0, 4 * turn);
  axis.control(0x3F);
  axis.run_ms(10);
  axis.control(0x0F);
  double furthest = 0.0;
  while (axis.turns() < 2.5) axis.run_ms(1);
  axis.set(0x6084, 0, 5 * turn);
  axis.set(0x607A, 0, 0);
  axis.control(0x3F);
  for (int i = 0; i < 6000; ++i) {
    axis.run_ms(1);
    furthest = std::max(furthest, axis.turns());
  }
  EXPECT_LT(furthest, 5.05);
}

}  // namespace
}  // namespace idle_modes_test
}  // namespace servodrome
