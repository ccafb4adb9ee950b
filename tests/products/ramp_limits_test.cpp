#include <array>
#include <cmath>
#include <gtest/gtest.h>

#include "reference_axis.hpp"

// 60C5h and 60C6h limit the ramps of every mode with a profile, and apply at once when they are written in motion.
namespace servodrome {
namespace ramp_limits_test {
namespace {

using test::Reference;

constexpr std::int64_t turn = 131072;
constexpr std::uint16_t max_acceleration = 0x60C5;
constexpr std::uint16_t max_deceleration = 0x60C6;

// The change of speed in this time, turns/s^2.
double slope(Reference& axis, double milliseconds) {
  const double before = axis.turns_per_s();
  axis.run_ms(milliseconds);
  return (axis.turns_per_s() - before) * 1000.0 / milliseconds;
}

TEST(RampLimits, OfHoming) {
  Reference axis(6);
  axis.set(max_acceleration, 0, 10 * turn);
  axis.set(max_deceleration, 0, 5 * turn);
  axis.set(0x6098, 0, 18);  // to the positive limit switch
  axis.set(0x6099, 1, 4 * turn);
  axis.set(0x6099, 2, turn / 4);
  axis.set(0x609A, 0, 1000 * turn);
  axis.control(0x1F);
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), 10.0, 0.5);
  axis.set(max_acceleration, 0, 2 * turn);  // in motion
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), 2.0, 0.3);
  axis.set(max_acceleration, 0, 0);
  axis.run_ms(500);
  ASSERT_NEAR(axis.turns_per_s(), 4.0, 0.1);
  axis.plant.force_input(0, true);
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), -5.0, 0.3);
}

TEST(RampLimits, OfVelocityMode) {
  Reference axis(2);
  axis.set(max_acceleration, 0, 10 * turn);
  axis.set(max_deceleration, 0, 5 * turn);
  for (const auto ramp : std::to_array<std::uint16_t>({0x6048, 0x6049})) {
    axis.set(ramp, 1, 60000);  // 1000 turns/s^2
    axis.set(ramp, 2, 1);
  }
  axis.set(0x6042, 0, 240);
  axis.control(0x7F);
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), 10.0, 0.5);
  axis.run_ms(400);
  ASSERT_NEAR(axis.turns_per_s(), 4.0, 0.1);
  axis.set(0x6042, 0, 0);
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), -5.0, 0.3);
}

TEST(RampLimits, OfProfileVelocityInMotion) {
  Reference axis(3);
  axis.set(0x60FF, 0, 10 * turn);
  axis.run_ms(100);
  axis.set(max_acceleration, 0, turn);
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), 1.0, 0.2);
  axis.set(max_acceleration, 0, 0);
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), 10.0, 0.5);
  axis.set(0x60FF, 0, 0);
  axis.run_ms(20);
  axis.set(max_deceleration, 0, 2 * turn);
  axis.run_ms(20);
  EXPECT_NEAR(slope(axis, 200), -2.0, 0.2);
}

// 60C5h and 60C6h are lowered at half a turn and at `place` of a way of 20 turns.
struct Lowered {
  double place;
  double deceleration;  // that the axis must have then
};
TEST(RampLimits, OfProfilePositionInMotion) {
  for (const Lowered& row : {Lowered{5.0, 1.0}, Lowered{17.0, 10.0}}) {
    SCOPED_TRACE(row.place);
    Reference axis(1);
    axis.set(0x6081, 0, 5 * turn);
    test::absolute_move(axis, 20 * turn, 0x1F);
    ASSERT_GE(axis.run_until([&] { return axis.turns() > 0.5; }, 2000), 0);
    axis.set(max_acceleration, 0, turn);
    axis.run_ms(20);
    EXPECT_NEAR(slope(axis, 200), 1.0, 0.2);
    axis.set(max_acceleration, 0, 0);
    ASSERT_GE(axis.run_until([&] { return axis.turns() > row.place; }, 8000), 0);
    ASSERT_NEAR(axis.turns_per_s(), 5.0, 0.1);
    axis.set(max_deceleration, 0, turn);  // 12.5 turns to come to rest
    double furthest = 0.0;
    double steepest = 0.0;
    for (int i = 0; i < 60; ++i) {
      steepest = std::max(steepest, -slope(axis, 100));
      furthest = std::max(furthest, axis.turns());
    }
    EXPECT_NEAR(steepest, row.deceleration, 0.1 * row.deceleration);
    axis.run_ms(4000);
    EXPECT_LT(furthest, 20.01) << "not beyond its target";
    EXPECT_NEAR(axis.turns(), 20.0, 0.001);
    EXPECT_TRUE(axis.bit(10));
  }
}

}  // namespace
}  // namespace ramp_limits_test
}  // namespace servodrome
