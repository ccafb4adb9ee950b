#include <cmath>
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/pronet/pronet.hpp"
#include "reference_axis.hpp"

// The behaviour after a halt, a limit, or the reset of a mode's bit during an action. The test measures the true shaft.
namespace servodrome {
namespace halt_sequences_test {
namespace {

using products::Generic402;
using products::Pronet;
using test::Reference;
using test::Rig;

// --- Homing

constexpr std::uint16_t home_bits = 1U << 13 | 1U << 12 | 1U << 10;
constexpr std::uint16_t found = 1U << 12 | 1U << 10;

struct Homing : Reference {
  explicit Homing(std::int64_t method) : Reference(6) {
    set(0x6098, 0, method);
    set(0x6099, 1, 131072 * 8);
    set(0x6099, 2, 131072 * 2);
    set(0x609A, 0, 131072 * 60);
    control(0x0F);
    run_ms(2);
    control(0x1F);
  }
};

// The edge of the index may also come during the ramp of a halt.
TEST(HaltedHoming, FindsTheSameHome) {
  for (const std::int64_t method : {33, 34}) {
    Homing undisturbed(method);
    undisturbed.run_ms(2500);
    ASSERT_EQ(undisturbed.status() & home_bits, found);
    for (int before_ms = 5; before_ms < 700; before_ms += 5) {
      Homing axis(method);
      axis.run_ms(before_ms);
      axis.control(0x11F);
      axis.run_ms(150);
      ASSERT_NEAR(axis.turns_per_s(), 0.0, 0.05) << before_ms;
      axis.control(0x1F);
      axis.run_ms(2500);
      ASSERT_EQ(axis.status() & home_bits, found) << before_ms;
      ASSERT_NEAR(axis.turns(), undisturbed.turns(), 0.001) << "method " << method << ", halted after " << before_ms;
    }
  }
}

// Homing that begins in motion uses the state of the switch at the place where the axis comes to rest.
TEST(HomingInMotion, BeginsWithTheSwitchWhereItStands) {
  for (int before_ms = 0; before_ms < 200; before_ms += 10) {
    Reference axis(3);
    axis.set(0x2030, 2, static_cast<std::int64_t>(drive::Signal::home));
    axis.set(0x6098, 0, 19);  // to the left of the switch, from either side of its edge
    axis.set(0x6099, 1, 131072 * 2);
    axis.set(0x6099, 2, 131072 / 2);
    axis.set(0x609A, 0, 131072 * 20);
    axis.set(0x60FF, 0, 131072 * 2);
    axis.run_ms(300);
    const double edge = axis.turns() + 0.3;
    const auto run = [&](int milliseconds) {
      for (int i = 0; i < milliseconds; ++i) {
        axis.plant.force_input(1, axis.turns() > edge);
        axis.run_ms(1);
      }
    };
    run(before_ms);
    axis.set(0x6060, 0, 6);
    axis.control(0x1F);
    run(4000);
    ASSERT_EQ(axis.status() & home_bits, found) << before_ms;
    ASSERT_NEAR(axis.turns(), edge, 0.1) << before_ms;
  }
}

// --- Interpolated position: bit 4 is reset

// A master that sends a record with a SYNC each millisecond: 10 turns/s.
template <typename Product>
struct Interpolating : Rig<Product> {
  // Ramps in the product's units.
  Interpolating(std::int64_t ramp, std::int64_t quick) {
    this->set(0x6083, 0, ramp);
    this->set(0x6084, 0, ramp);
    this->set(0x6085, 0, quick);
    this->set(0x605D, 0, 2);
    this->set(0x6060, 0, 7);
    this->set(0x60C2, 1, 1);
    this->set(0x60C2, 2, -3);
    EXPECT_TRUE(this->enable());
    this->control(0x1F);
    send(300);
    EXPECT_NEAR(std::abs(this->plant.velocity_rpm()), 600.0, 20.0);
  }
  void send(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) {
      this->set(0x60C1, 1, record += 1310);
      this->device.drive().synchronise();
      this->run_ms(1);
    }
  }
  // Returns the distance in turns from the command that ends the motion. `word` is the command, `later` follows 10 ms
  // after it.
  double way_after(std::uint16_t word, std::uint16_t later) {
    const auto there = this->plant.position_counts();
    this->control(word);
    send(10);
    this->control(later);
    send(4000);
    EXPECT_NEAR(this->plant.velocity_rpm(), 0.0, 1.0);
    return std::abs(static_cast<double>(this->plant.position_counts() - there)) / 131072.0;
  }
  std::int64_t record = 0;
};

TEST(InterpolationGivenUp, ComesToRestByTheProfilesRamp) {
  Interpolating<Generic402> rig(131072 * 50, 131072 * 100);
  rig.control(0x0F);
  double before = rig.plant.velocity_rpm();
  for (int i = 0; i < 190; ++i) {
    rig.run_ms(1);
    const double now = rig.plant.velocity_rpm();
    ASSERT_GT(now, before - 8.0) << "6084h takes 3 rpm in a millisecond";
    before = now;
  }
  rig.run_ms(100);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
}

// A stop in progress keeps its own ramp, whatever the value of bit 4.
TEST(InterpolationGivenUp, LeavesAStopItsRamp) {
  const auto reference = [](std::uint16_t word, std::uint16_t later) {
    return Interpolating<Generic402>(131072 * 5, 131072 * 100).way_after(word, later);
  };
  const auto pronet = [](std::uint16_t word, std::uint16_t later) {
    return Interpolating<Pronet>(3000, 60000).way_after(word, later);
  };
  EXPECT_LT(reference(0x11F, 0x11F), 1.0);
  EXPECT_NEAR(reference(0x11F, 0x11F), reference(0x11F, 0x10F), 0.1);
  EXPECT_NEAR(reference(0x11F, 0x11F), reference(0x10F, 0x10F), 0.1);
  EXPECT_LT(pronet(0x11F, 0x11F), 1.0);
  EXPECT_NEAR(pronet(0x11F, 0x11F), pronet(0x11F, 0x10F), 0.1);
  EXPECT_NEAR(pronet(0x11F, 0x11F), pronet(0x10F, 0x10F), 0.1);
}

// --- Limits

// 607Dh is within the range 607Bh, in which positions wrap around.
TEST(SoftwareLimitInARange, HoldsTheModesWithoutATargetPosition) {
  for (const std::int64_t mode : {3, 4, 9, 10}) {
    SCOPED_TRACE(mode);
    Reference axis(mode);
    axis.set(0x607B, 1, -131072 * 10);
    axis.set(0x607B, 2, 131072 * 10 - 1);
    axis.limit_turns(-3.0, 3.0);
    axis.set(0x6085, 0, 131072 * 100);
    axis.set(0x60FF, 0, 131072 * 5);
    axis.set(0x6071, 0, 100);
    double furthest = 0.0;
    for (int i = 0; i < 3000; ++i) {
      axis.run_ms(1);
      furthest = std::max(furthest, axis.turns());
    }
    EXPECT_NEAR(axis.turns(), 3.0, 0.1);
    EXPECT_LT(furthest, 3.1);
    EXPECT_TRUE(axis.bit(11));
  }
}

// 607Dh extends beyond an end of the range: behind that end the positions continue where 607Dh forbids them.
struct HalfBound : Reference {
  explicit HalfBound(std::int64_t mode) : Reference(mode) { set(0x6085, 0, 131072 * 100); }
  void bind() {
    set(0x607B, 1, -131072 * 2);
    set(0x607B, 2, 131072 * 10 - 1);
    limit_turns(-50.0, 5.0);
  }
  double least_in(int milliseconds) {
    double least = turns();
    for (int i = 0; i < milliseconds; ++i) run_ms(1), least = std::min(least, turns());
    return least;
  }
};

TEST(SoftwareLimitInARange, AnEndOfTheRangeIsALimitAsWell) {
  for (const std::int64_t mode : {3, 4, 9, 10}) {
    SCOPED_TRACE(mode);
    HalfBound axis(mode);
    axis.bind();
    axis.set(0x60FF, 0, -131072 * 5);
    axis.set(0x6071, 0, -100);
    EXPECT_GT(axis.least_in(3000), -2.1);
    EXPECT_NEAR(axis.turns(), -2.0, 0.1);
    EXPECT_TRUE(axis.bit(11));
    axis.set(0x60FF, 0, 131072 * 5);
    axis.set(0x6071, 0, 100);
    axis.run_ms(3000);
    EXPECT_NEAR(axis.turns(), 5.0, 0.1) << "the way back is free, up to the other one";
  }
}

// A shaft slightly beyond the end shows a position at the other end of the range.
TEST(SoftwareLimitInARange, TargetsAreThoseOfTheNearerLimitFromBeyondAnEnd) {
  for (const std::int64_t mode : {1, 8}) {
    SCOPED_TRACE(mode);
    HalfBound axis(1);
    test::absolute_move(axis, -131072 * 2 - 300, 0x1F);
    axis.run_ms(3000);
    axis.bind();
    axis.set(0x6060, 0, mode);
    axis.run_ms(50);
    ASSERT_GT(axis.get(0x6064), 131072 * 9);
    if (mode == 1) test::absolute_move(axis, -131072, 0x1F);
    for (int i = 0; i < 3000 && mode == 8; ++i) axis.set(0x607A, 0, -131072), axis.run_ms(1);
    EXPECT_GT(axis.least_in(4000), -2.01);
    EXPECT_NEAR(axis.turns(), -1.0, 0.001);
  }
}

// If 607Dh allows the whole range or more, there is no limit: positions wrap around.
TEST(SoftwareLimitInARange, AsWideAsTheRangeForbidsNothing) {
  for (const auto& [low, high] : {std::pair<std::int64_t, std::int64_t>{0, 131071}, {-1000, 200000}, {-1000, 131071}}) {
    SCOPED_TRACE(high);
    Reference axis(1);
    axis.set(0x607B, 1, 0);
    axis.set(0x607B, 2, 131071);
    axis.set(0x607D, 1, low);
    axis.set(0x607D, 2, high);
    axis.set(0x60F2, 0, 0xC0);  // the shorter way round
    for (const std::int64_t target : {120000, 10000, 120000, 60000}) {
      test::absolute_move(axis, target, 0x1F);
      axis.run_ms(3000);
      EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), static_cast<double>(target), 3.0);
      EXPECT_TRUE(axis.bit(10));
      EXPECT_FALSE(axis.bit(11));
    }
  }
}

// Ramps with a jerk-limited shape need up to twice the distance of a linear ramp with the same deceleration.
TEST(SoftwareLimits, ShapedStopsEndBeforeThem) {
  for (const std::int64_t shape : {0, 1, 2, 3}) {
    for (const bool halts : {true, false}) {  // or it changes the mode
      for (const double quick : {5.0, 10.0, 20.0}) {
        SCOPED_TRACE(shape);
        SCOPED_TRACE(quick);
        Reference axis(3);
        axis.set(0x6083, 0, 131072 * 100);
        axis.set(0x6085, 0, std::lround(131072 * quick));
        axis.set(0x60A4, 1, 3'000'000);
        axis.limit_turns(-50.0, 3.0);
        axis.set(0x6086, 0, shape);
        axis.set(0x60FF, 0, 131072 * 5);
        ASSERT_GE(axis.run_until([&] { return axis.turns() > 1.65; }, 3000), 0);
        if (halts) axis.control(0x10F);
        if (!halts) axis.set(0x6060, 0, 1);
        double furthest = 0.0;
        for (int i = 0; i < 3000; ++i) axis.run_ms(1), furthest = std::max(furthest, axis.turns());
        EXPECT_LT(furthest, 3.03);
      }
    }
  }
}

// A set-point whose motion leads past a limit and back brakes before the limit, and continues to its target.
TEST(SoftwareLimits, ASetPointGoesOnAfterTheBrakeBeforeThem) {
  for (const bool halted : {false, true}) {
    SCOPED_TRACE(halted);
    Reference axis(1);
    axis.limit_turns(-2.0, 2.0);
    axis.set(0x6081, 0, 131072 * 4);
    axis.set(0x6085, 0, 131072 * 10);
    test::absolute_move(axis, 200'000, 0x1F);
    test::absolute_move(axis, 0, 0x21F);  // passes the first target at its speed
    double furthest = 0.0;
    const auto run = [&](int milliseconds) {
      for (int i = 0; i < milliseconds; ++i) axis.run_ms(1), furthest = std::max(furthest, axis.turns());
    };
    if (halted) {  // while it brakes
      ASSERT_GE(axis.run_until([&] { return axis.bit(11) && axis.turns() > 1.5; }, 3000), 0);
      axis.control(0x10F);
      run(50);
      axis.control(0x0F);
    }
    run(6000);
    EXPECT_LT(furthest, 2.01);
    EXPECT_TRUE(axis.bit(10));
    EXPECT_NEAR(axis.turns(), 0.0, 0.001);
  }
}

// A switch that opens again and a halt that ends do not count as commands to continue.
TEST(AfterALimitSwitch, AVelocityWaitsForAnotherTarget) {
  for (const std::int64_t mode : {3, 9}) {
    SCOPED_TRACE(mode);
    Reference axis(mode);
    axis.set(0x6085, 0, 131072 * 100);
    axis.set(0x60FF, 0, 131072 * 5);
    axis.run_ms(1000);
    ASSERT_NEAR(axis.turns_per_s(), 5.0, 0.1);
    axis.plant.force_input(0, true);
    axis.run_ms(500);
    ASSERT_NEAR(axis.turns_per_s(), 0.0, 0.01);
    EXPECT_EQ(axis.bit(12), mode == 3) << "speed is 0; follows the command value";
    const double there = axis.turns();
    axis.plant.force_input(0, false);
    axis.run_ms(500);
    axis.control(0x10F);
    axis.run_ms(50);
    axis.control(0x0F);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns(), there, 0.01);
    EXPECT_TRUE(axis.bit(11));
    axis.set(0x60FF, 0, 131072 * 4);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 4.0, 0.1);
    EXPECT_FALSE(axis.bit(11));
  }
}

}  // namespace
}  // namespace halt_sequences_test
}  // namespace servodrome
