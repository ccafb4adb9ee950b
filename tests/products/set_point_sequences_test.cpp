#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "products/generic402/generic402.hpp"
#include "products/pronet/pronet.hpp"
#include "reference_axis.hpp"

// Events between a set-point and its end, or before it: halts, software limits within a range, other modes. The test
// measures the true shaft.
namespace servodrome {
namespace set_point_sequences_test {
namespace {

using products::Generic402;
using products::Pronet;
using test::Reference;
using test::Rig;

void absolute(auto& rig, std::int64_t target, std::uint16_t bits = 0) {
  const auto word = static_cast<std::uint16_t>(0x2F | bits);
  rig.set(0x607A, 0, target);
  rig.control(word);
  rig.run_ms(2);
  rig.control(word | 0x10);
  rig.run_ms(2);
  rig.control(word);
}

// --- A halt that ends beyond a target with an end velocity 6082h

template <typename RigType>
void goes_on_after_a_halt(RigType& rig, double end_rpm) {
  rig.control(0x10F);
  rig.run_ms(700);
  ASSERT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.5);
  ASSERT_GT(rig.plant.position_counts(), rig.get(0x607A));
  const std::int64_t stood = rig.plant.position_counts();
  rig.control(0x0F);
  for (int i = 0; i < 1500; ++i) {
    rig.run_ms(1);
    ASSERT_GT(rig.plant.velocity_rpm(), -1.0) << i;
  }
  EXPECT_NEAR(rig.plant.velocity_rpm(), end_rpm, 1.0);
  EXPECT_GT(rig.plant.position_counts(), stood + 131072);
}
// Halted after the target has been passed.
template <typename Product>
void halted_beyond(std::int64_t end_velocity, std::int64_t ramp, double end_rpm) {
  Rig<Product> rig;
  rig.set(0x6060, 0, 1);
  rig.set(0x6081, 0, 2 * end_velocity);
  rig.set(0x6082, 0, end_velocity);
  rig.set(0x6083, 0, ramp);
  rig.set(0x6084, 0, ramp);
  rig.set(0x6085, 0, 2 * ramp);
  ASSERT_TRUE(rig.enable());
  absolute(rig, 131072);
  rig.run_ms(1500);
  ASSERT_NEAR(rig.plant.velocity_rpm(), end_rpm, 1.0);
  goes_on_after_a_halt(rig, end_rpm);
}
TEST(EndVelocity, GoesOnAfterAHaltBeyondTheTarget) {
  halted_beyond<Generic402>(131072, 1310720, 60.0);
  halted_beyond<Pronet>(3000, 100000, 300.0);
}
// Halted before the target, with a ramp that ends beyond it.
TEST(EndVelocity, GoesOnAfterAHaltThatPassesTheTarget) {
  for (const int shape : {0, 1, 2, 3}) {
    SCOPED_TRACE(shape);
    Reference axis(1);
    axis.set(0x6082, 0, std::lround(131072 * 1.9));
    axis.set(0x6085, 0, 131072 * 20);
    axis.set(0x60A4, 1, 131072 * 200);
    axis.set(0x6086, 0, shape);
    absolute(axis, 131072);
    axis.run_ms(560);
    ASSERT_LT(axis.turns(), 1.0);
    goes_on_after_a_halt(axis, 114.0);
  }
}

// --- The software limits 607Dh within a position range 607Bh

struct Ranged : Reference {
  Ranged() : Reference(1) {
    set(0x607B, 1, 0);
    set(0x607B, 2, 131071);
    set(0x6081, 0, 131072 * 5);
    set(0x6083, 0, 131072 * 50);
    set(0x6084, 0, 131072 * 50);
    absolute(*this, 3 * 131072 + 20000, 0x40);
    run_ms(2500);
    EXPECT_NEAR(turns(), 3.0 + 20000.0 / 131072.0, 0.001);
    EXPECT_NEAR(static_cast<double>(get(0x6064)), 20000.0, 10.0);
    set(0x607D, 1, 13107);
    set(0x607D, 2, 118000);
    run_ms(100);
  }
  void expect_inside_on_the_way_to(double target) {
    for (int i = 0; i < 1500; ++i) {
      run_ms(1);
      ASSERT_GT(get(0x6064), 13107) << i;
      ASSERT_LT(get(0x6064), 118000) << i;
    }
    EXPECT_NEAR(static_cast<double>(get(0x6064)), target, 20.0);
    EXPECT_NEAR(turns(), 3.0 + target / 131072.0, 0.001) << "the same turn";
  }
};
TEST(LimitsInARange, ProfilePositionGoesTheWayInside) {
  Ranged axis;
  absolute(axis, 60000);
  axis.expect_inside_on_the_way_to(60000);
  absolute(axis, 115000);
  axis.expect_inside_on_the_way_to(115000);
  absolute(axis, 14000);
  axis.expect_inside_on_the_way_to(14000);
}
TEST(LimitsInARange, CyclicPositionGoesTheWayInside) {
  Ranged axis;
  axis.set(0x607A, 0, 20000);
  axis.set(0x60C2, 1, 1);
  axis.set(0x60C2, 2, -3);
  axis.set(0x6060, 0, 8);
  axis.run_ms(10);
  axis.set(0x607A, 0, 115000);
  axis.expect_inside_on_the_way_to(115000);
  axis.set(0x607A, 0, 20000);
  axis.expect_inside_on_the_way_to(20000);
}

// --- An old target

// Table 5-4: with 103Fh the axis follows a "change of target position" in position mode; a target that was written
// before the mode began does not count as one.
TEST(FollowedTarget, IsmkIsNotTheOneOfAnotherMode) {
  test::IsmkRig rig;
  rig.set(0x6060, 0, 3);
  rig.set(0x6081, 0, std::llround(products::ismk::velocity_dec_from_rpm(300)));
  ASSERT_TRUE(rig.enable());
  rig.control(0x103F);
  rig.run_ms(100);
  rig.set(0x607A, 0, 300000);
  rig.run_ms(300);
  rig.set(0x6060, 0, 1);
  rig.run_ms(600);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 0.0, 10.0);
  rig.set(0x607A, 0, 65536);
  rig.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 65536.0, 10.0) << "a target of this mode is followed";
}

}  // namespace
}  // namespace set_point_sequences_test
}  // namespace servodrome
