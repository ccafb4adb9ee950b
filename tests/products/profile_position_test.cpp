#include <cmath>
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// Profile position mode: set-points, targets, limits, units (CiA 402-2 clauses 8 and 10; ISMC manual, ch. 4.3).
namespace servodrome {
namespace profile_position_test {
namespace {

using dictionary::AbortCode;
using products::Generic402;
using products::Ismc;
using test::Rig;

constexpr std::uint16_t acknowledge = 0x1000;
constexpr std::uint16_t reached = 0x0400;
constexpr std::uint16_t limited = 0x0800;

template <typename DeviceType>
struct Positioning : Rig<DeviceType> {
  using Base = Rig<DeviceType>;
  explicit Positioning(const plant::Parameters& parameters = test::default_plant()) : Base(parameters) {
    must(0x6060, 0, 1);
    must(0x6081, 0, 500000);
  }
  void must(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    EXPECT_EQ(this->set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub};
  }
  // Gives a set-point with its handshake; `bits` of the controlword in addition to 0Fh.
  void give(std::int64_t target, std::uint16_t bits = 0) {
    must(0x607A, 0, target);
    this->control(static_cast<std::uint16_t>(0x0F | bits));
    this->control(static_cast<std::uint16_t>(0x1F | bits));
    this->run_ms(1);
    this->control(static_cast<std::uint16_t>(0x0F | bits));
    this->run_ms(1);
  }
  void arrive(double limit_ms = 30000.0) {
    ASSERT_GE(this->run_until([&] { return !this->device.drive().in_motion(); }, limit_ms), 0);
    this->run_ms(1);
  }
  std::int64_t demand() { return this->get(0x60FC); }
  double demand_velocity() { return this->device.drive().axis().generator.velocity(); }
};

// The positions at which the demand reversed or rested, in order.
template <typename DeviceType>
std::vector<std::int64_t> turning_points(Positioning<DeviceType>& axis, double limit_ms) {
  std::vector<std::int64_t> points;
  double before = 0.0;
  for (int i = 0; i < static_cast<int>(limit_ms * 2.0); ++i) {
    const std::int64_t here = axis.demand();
    axis.run_ms(0.5);
    const double now = axis.demand_velocity();
    if (before * now < 0.0 || (before != 0.0 && now == 0.0)) points.push_back(now == 0.0 ? axis.demand() : here);
    before = now;
  }
  return points;
}

TEST(SetPoints, IsmcQueuesSixteenBehindTheRunningOne) {
  Positioning<Ismc> axis;
  ASSERT_TRUE(axis.enable());
  std::vector<std::int64_t> targets;
  for (int i = 0; i < 17; ++i) targets.push_back((i % 2 == 0 ? 1 : -1) * (3000 + 500 * i));
  axis.must(0x6083, 0, 100000);  // slow enough to give all set-points while the first one is in progress
  axis.must(0x6084, 0, 100000);
  for (std::size_t i = 0; i < targets.size(); ++i) {
    SCOPED_TRACE(i);
    axis.must(0x607A, 0, targets[i]);
    EXPECT_EQ(axis.status() & acknowledge, 0);
    axis.control(0x1F);
    EXPECT_EQ(axis.status() & acknowledge, acknowledge);
    axis.run_ms(1);
    EXPECT_EQ(axis.status() & acknowledge, acknowledge);
    axis.control(0x0F);
    axis.run_ms(1);
    EXPECT_EQ(axis.status() & acknowledge, i < 16 ? 0 : acknowledge) << "the queue is full behind the seventeenth";
  }
  axis.must(0x607A, 0, 99999);  // the buffer is full: no effect
  axis.control(0x1F);
  axis.control(0x0F);
  std::vector<std::int64_t> points = turning_points(axis, 30000.0);
  ASSERT_EQ(points.size(), targets.size());
  for (std::size_t i = 0; i < targets.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(points[i]), static_cast<double>(targets[i]), 1.0) << i;
  }
  EXPECT_EQ(axis.status() & (acknowledge | reached), reached);
  EXPECT_EQ(axis.get(0x6064), targets.back());
}

TEST(SetPoints, ReferenceDriveHasOneBehindTheRunningOne) {
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.give(100000);
  EXPECT_EQ(axis.status() & acknowledge, 0);
  axis.give(50000);
  EXPECT_EQ(axis.status() & acknowledge, acknowledge) << "the buffer is full";
  axis.give(777);  // not accepted
  const std::vector<std::int64_t> points = turning_points(axis, 5000.0);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_NEAR(static_cast<double>(points[0]), 100000.0, 1.0);
  EXPECT_EQ(points[1], 50000);
  EXPECT_EQ(axis.status() & (acknowledge | reached), reached);
}

TEST(SetPoints, TargetMayComeInAnotherPdoOfTheSameSync) {
  Positioning<Ismc> axis;
  ASSERT_TRUE(axis.enable());
  axis.must(0x1401, 1, 0x80000301);
  axis.must(0x1601, 0, 0);
  axis.must(0x1601, 1, 0x607A0020);
  axis.must(0x1601, 0, 1);
  axis.must(0x1400, 1, 0x80000201);
  axis.must(0x1600, 0, 0);
  axis.must(0x1600, 1, 0x60400010);
  axis.must(0x1600, 0, 1);
  for (const std::uint16_t index : {std::uint16_t{0x1400}, std::uint16_t{0x1401}}) {
    axis.must(index, 2, 1);
    axis.must(index, 1, index == 0x1400 ? 0x201 : 0x301);
  }
  axis.send(0, {1, 0});
  axis.send(0x201, {0x1F, 0x00});  // first the controlword
  axis.send(0x301, {0x10, 0x27, 0x00, 0x00});
  axis.run_ms(5);
  EXPECT_EQ(axis.demand(), 0) << "before SYNC";
  axis.send(0x80, {});
  axis.run_ms(2);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 10000);
}

TEST(SetPoints, QueuedPointFreesTheBufferWhenItStarts) {
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.give(100000);
  axis.give(300000);
  EXPECT_EQ(axis.status() & acknowledge, acknowledge);
  ASSERT_GE(axis.run_until([&] { return (axis.status() & acknowledge) == 0; }, 5000.0), 0);
  EXPECT_NEAR(static_cast<double>(axis.demand()), 100000.0, 500.0);
  EXPECT_EQ(axis.status() & reached, 0);
}

TEST(SetPoints, HeldBitFourIsOneSetPoint) {
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.must(0x607A, 0, 10000);
  axis.control(0x5F);
  for (int i = 0; i < 100; ++i) {
    axis.run_ms(5);
    axis.control(0x5F);
  }
  EXPECT_EQ(axis.demand(), 10000);
  EXPECT_EQ(axis.status() & acknowledge, acknowledge);
}

TEST(SetPoints, ChangeImmediatelyReplacesTheMotionAndDropsTheQueue) {
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.give(1000000);
  axis.give(2000000);
  axis.run_ms(300);
  const double before = axis.demand_velocity();
  EXPECT_GT(before, 300000.0);
  axis.must(0x607A, 0, 400000);
  axis.must(0x6081, 0, 200000);
  axis.control(0x3F);
  axis.run_ms(0.5);
  EXPECT_NEAR(axis.demand_velocity(), before, 1000.0);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 400000);
  axis.run_ms(1000);
  EXPECT_EQ(axis.demand(), 400000);
}

TEST(SetPoints, ChangeOnSetPointPassesTheFirstAtItsProfileVelocity) {
  for (const bool pass : {true, false}) {
    SCOPED_TRACE(pass);
    Positioning<Generic402> axis;
    ASSERT_TRUE(axis.enable());
    axis.must(0x6081, 0, 200000);
    axis.give(100000);
    axis.must(0x6081, 0, 400000);
    axis.give(300000, pass ? 0x200 : 0);
    ASSERT_GE(axis.run_until([&] { return axis.demand() >= 99999; }, 5000.0), 0);
    if (pass) {
      EXPECT_NEAR(axis.demand_velocity(), 200000.0, 2000.0);
    } else {
      EXPECT_LT(axis.demand_velocity(), 5000.0);
    }
    ASSERT_GE(axis.run_until([&] { return (axis.status() & reached) != 0; }, 5000.0), 0);
    EXPECT_EQ(axis.demand(), 300000);
    EXPECT_EQ(axis.status() & reached, reached);
  }
}

TEST(SetPoints, WhatRelativeIsRelativeTo) {  // 60F2h bits 0 and 1
  for (const int option : {0, 1, 2}) {
    SCOPED_TRACE(option);
    Positioning<Generic402> axis;
    axis.must(0x60F2, 0, option);
    ASSERT_TRUE(axis.enable());
    axis.give(1000000);
    axis.run_ms(500);
    axis.must(0x607A, 0, 5000);
    const double demand = static_cast<double>(axis.demand());
    const double actual = static_cast<double>(axis.get(0x6063));
    axis.control(0x7F);
    axis.arrive();
    const double expected = option == 0 ? 1000000.0 : option == 1 ? demand : actual;
    EXPECT_NEAR(static_cast<double>(axis.demand()), expected + 5000.0,
                option == 0   ? 0.0
                : option == 1 ? 1.0
                              : 300.0);  // the demand moved on for half a millisecond
  }
  Positioning<Ismc> axis;  // the demand when the point is started (ch. 4.3.3, G16)
  ASSERT_TRUE(axis.enable());
  axis.give(1000000);
  axis.run_ms(500);
  axis.must(0x607A, 0, 5000);
  const double demand = static_cast<double>(axis.demand());
  axis.control(0x7F);
  axis.arrive();
  EXPECT_NEAR(static_cast<double>(axis.demand()), demand + 5000.0, 1.0);
}

TEST(SetPoints, EndVelocityIsPassedWithAndKept) {
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.must(0x6082, 0, 50000);
  axis.give(200000);
  ASSERT_GE(axis.run_until([&] { return axis.demand() >= 200000; }, 5000.0), 0);
  EXPECT_NEAR(axis.demand_velocity(), 50000.0, 1.0);
  axis.run_ms(100);
  EXPECT_NEAR(axis.demand_velocity(), 50000.0, 1.0);
  EXPECT_NEAR(static_cast<double>(axis.demand()), 205000.0, 100.0);
  axis.must(0x6082, 0, 0);
  axis.give(300000);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 300000);
}

// A motion that another mode ended is over: later writes in profile position must not continue it.
TEST(SetPoints, AnotherModeEndsTheMotion) {
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.give(2000000);
  axis.run_ms(600);
  ASSERT_GT(axis.demand_velocity(), 100000.0);
  axis.must(0x60FF, 0, 300000);
  axis.must(0x6060, 0, 3);
  axis.run_ms(500);
  axis.must(0x6060, 0, 1);
  axis.run_ms(1);
  EXPECT_NEAR(axis.demand_velocity(), 300000.0, 3000.0) << "it comes to rest from there";
  const std::int64_t there = axis.demand();
  axis.must(0x607F, 0, 200000);
  axis.arrive();
  const std::int64_t rest = axis.demand();
  EXPECT_GT(rest, there + 10000) << "straight on";
  axis.must(0x607F, 0, 100000);
  axis.run_ms(500);
  EXPECT_EQ(axis.demand(), rest);
  EXPECT_EQ(axis.demand_velocity(), 0.0);
}

TEST(SetPoints, EndVelocityAboveTheProfileVelocityIsClipped) {
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.must(0x6082, 0, 900000);
  axis.must(0x6081, 0, 100000);
  axis.give(200000);
  ASSERT_GE(axis.run_until([&] { return axis.demand() >= 200000; }, 5000.0), 0);
  EXPECT_NEAR(axis.demand_velocity(), 100000.0, 1.0);
}

TEST(Limits, SpeedAndAccelerationAreClipped) {  // 607Fh, 6080h, 60C5h, 60C6h
  Positioning<Generic402> axis;
  ASSERT_TRUE(axis.enable());
  axis.must(0x607F, 0, 300000);
  axis.must(0x60C5, 0, 655360);
  axis.must(0x60C6, 0, 2621440);
  axis.must(0x6084, 0, 5242880);
  const std::int64_t begin = axis.ticks();
  axis.give(1000000);
  double most = 0.0;
  while (axis.device.drive().in_motion()) {
    axis.run_ms(0.5);
    most = std::max(most, axis.demand_velocity());
  }
  EXPECT_NEAR(most, 300000.0, 1.0);
  const double ramps = 300000.0 / 655360.0 / 2.0 + 300000.0 / 2621440.0 / 2.0;
  EXPECT_NEAR(static_cast<double>(axis.ticks() - begin) / 16000.0, 1000000.0 / 300000.0 + ramps, 0.001);
  Positioning<Generic402> slow;
  slow.must(0x6080, 0, 60);  // rpm
  ASSERT_TRUE(slow.enable());
  slow.give(1000000);
  slow.run_ms(1000);
  EXPECT_NEAR(slow.demand_velocity(), 131072.0, 1.0);
}

TEST(Limits, TargetBeyondTheSoftwareLimitIsMovedToIt) {
  Positioning<Generic402> axis;
  axis.must(0x607D, 1, -10000);
  axis.must(0x607D, 2, 20000);
  ASSERT_TRUE(axis.enable());
  axis.give(50000);
  EXPECT_EQ(axis.status() & limited, limited);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 20000);
  axis.give(-50000, 0x40);
  axis.arrive();
  EXPECT_EQ(axis.demand(), -10000);
  axis.give(0);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & limited, 0);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 0);
  axis.must(0x607D, 1, 100);  // limits that contradict each other are off
  axis.must(0x607D, 2, -100);
  axis.give(50000);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 50000);
}

struct Way {
  std::int64_t from;
  std::int64_t to;
  std::uint16_t option;  // 60F2h bits 6 and 7
  std::int64_t distance;
};

TEST(Rotary, WaysToAnAbsoluteTarget) {  // CiA 402-2 60F2h, 607Bh; a turn of 3600 units
  constexpr std::uint16_t linear = 0x00;
  constexpr std::uint16_t negative = 0x40;
  constexpr std::uint16_t positive = 0x80;
  constexpr std::uint16_t shortest = 0xC0;
  for (const Way& way : {Way{0, 900, linear, 900}, Way{900, 300, linear, -600}, Way{3000, 100, linear, -2900},
                         Way{300, 900, negative, -3000}, Way{900, 300, negative, -600}, Way{900, 300, positive, 3000},
                         Way{300, 900, positive, 600}, Way{300, 3500, shortest, -400}, Way{3500, 300, shortest, 400},
                         Way{0, 1800, shortest, 1800}, Way{1800, 0, shortest, 1800}, Way{100, 1901, shortest, -1799},
                         Way{500, 500, negative, 0}, Way{500, 500, positive, 0}, Way{500, 500, shortest, 0},
                         Way{3599, 3600, positive, 1}, Way{0, -1, negative, -1}}) {
    SCOPED_TRACE(std::to_string(way.from) + " to " + std::to_string(way.to) +
                 ", 60F2h = " + std::to_string(way.option));
    Positioning<Generic402> axis;
    axis.must(0x607B, 1, 0);
    axis.must(0x607B, 2, 3599);
    ASSERT_TRUE(axis.enable());
    axis.give(way.from);
    axis.arrive();
    EXPECT_EQ(axis.get(0x6062), way.from);
    const std::int64_t before = axis.demand();
    axis.must(0x60F2, 0, way.option);
    axis.give(way.to);
    axis.arrive();
    EXPECT_EQ(axis.demand() - before, way.distance);
    EXPECT_EQ(axis.get(0x6062), (way.to + 3600) % 3600);
    axis.run_ms(100);
    const std::int64_t off = axis.get(0x6064) - axis.get(0x6062);  // one count, perhaps across the end of the range
    EXPECT_TRUE(off == 0 || std::abs(off) == 1 || std::abs(off) == 3599) << off;
  }
}

TEST(Rotary, RelativeTargetsMayBeTurnsAway) {
  Positioning<Generic402> axis;
  axis.must(0x607B, 1, -1800);
  axis.must(0x607B, 2, 1799);
  ASSERT_TRUE(axis.enable());
  axis.give(10000, 0x40);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 10000);
  EXPECT_EQ(axis.get(0x6062), 10000 - 3 * 3600);
}

TEST(Rotary, RangeOfTheIsmcIsOffWhileSoftwareLimitsAreValid) {  // ch. 4.3.5, 607Bh
  Positioning<Ismc> axis;
  axis.must(0x607B, 1, 0);
  axis.must(0x607B, 2, 9999);
  axis.must(0x607D, 1, 0);
  axis.must(0x607D, 2, 9999);
  ASSERT_TRUE(axis.enable());
  axis.give(9000);
  axis.arrive();
  EXPECT_EQ(axis.get(0x6062), 9000);
  axis.must(0x607D, 1, 0);
  axis.must(0x607D, 2, 0);
  axis.give(3000, 0x40);
  axis.arrive();
  EXPECT_EQ(axis.get(0x6062), 2000);
  EXPECT_EQ(axis.get(0x6063) / 10, 1200);
}

TEST(Units, FactorGroupWithoutDrift) {  // 608Fh x 6091h / 6092h
  for (const int option : {0, 1}) {
    SCOPED_TRACE(option);
    Positioning<Generic402> axis;
    axis.must(0x6091, 1, 7);
    axis.must(0x6091, 2, 3);
    axis.must(0x6092, 1, 360);
    axis.must(0x6092, 2, 1);
    axis.must(0x60F2, 0, option);
    const double counts_per_degree = 131072.0 * 7.0 / 3.0 / 360.0;
    axis.must(0x6081, 0, 2000);
    axis.must(0x6083, 0, 400000);
    axis.must(0x6084, 0, 400000);
    ASSERT_TRUE(axis.enable());
    for (int i = 0; i < 500; ++i) {
      axis.give(7, 0x40);
      axis.arrive();
    }
    EXPECT_NEAR(static_cast<double>(axis.demand()), 3500.0 * counts_per_degree, option == 0 ? 0.5 : 1.0);
    EXPECT_EQ(axis.get(0x6062), 3500);
    axis.run_ms(100);
    EXPECT_EQ(axis.get(0x6064), 3500);
    // The demand has not drifted. Friction holds the shaft some counts away.
    EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), 3500.0 * counts_per_degree, 4.0);
  }
}

TEST(Units, VelocityAndAccelerationAreInThemToo) {
  Positioning<Generic402> axis;
  axis.must(0x6092, 1, 3600);  // 0.1 degree
  axis.must(0x6081, 0, 36000);
  axis.must(0x6083, 0, 360000);
  axis.must(0x6084, 0, 360000);
  ASSERT_TRUE(axis.enable());
  axis.give(36000);
  axis.run_ms(48);
  EXPECT_NEAR(axis.demand_velocity(), 131072.0 * 10.0 * 0.5, 131072.0 * 10.0 * 0.011);  // 50 of 100 ms of ramp
  axis.run_ms(500);
  EXPECT_EQ(axis.get(0x606B), 36000);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 600.0, 6.0);
  axis.arrive();
  EXPECT_EQ(axis.demand(), 1310720);
}

TEST(Units, FactorsAreRefusedWhileEnabledOrWithoutARatio) {
  Positioning<Generic402> axis;
  EXPECT_NE(axis.set(0x6091, 2, 0), AbortCode::none);
  ASSERT_TRUE(axis.enable());
  EXPECT_EQ(axis.set(0x6091, 1, 2), AbortCode::device_state);
  EXPECT_EQ(axis.set(0x607E, 0, 0x80), AbortCode::device_state);
}

TEST(Units, PolarityTurnsTheAxisRound) {  // 607Eh
  Positioning<Generic402> axis;
  axis.must(0x607E, 0, 0xC0);
  axis.must(0x607D, 1, -5000);
  axis.must(0x607D, 2, 30000);
  ASSERT_TRUE(axis.enable());
  axis.give(20000);
  axis.run_ms(20);
  EXPECT_GT(axis.get(0x606B), 0);
  axis.arrive();
  axis.run_ms(100);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), -20000.0, 1.0);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6064)), 20000.0, 1.0);
  EXPECT_EQ(axis.get(0x6062), 20000);
  axis.give(-20000);
  axis.arrive();
  EXPECT_EQ(axis.get(0x6062), -5000);
}

TEST(Windows, TargetReachedAfterItsTimeInTheWindow) {  // 6067h, 6068h
  Positioning<Generic402> axis;
  axis.must(0x6067, 0, 100);
  axis.must(0x6068, 0, 200);
  ASSERT_TRUE(axis.enable());
  axis.give(100000);
  axis.arrive();
  const std::int64_t begin = axis.ticks();
  EXPECT_EQ(axis.status() & reached, 0);
  ASSERT_GE(axis.run_until([&] { return (axis.status() & reached) != 0; }, 1000.0), 0);
  EXPECT_NEAR(static_cast<double>(axis.ticks() - begin) / 16.0, 200.0, 15.0);
  axis.plant.set_external_torque_nm(3.7);  // more than the motor can hold at first
  ASSERT_GE(axis.run_until([&] { return (axis.status() & reached) == 0; }, 100.0), 0);
  EXPECT_GT(std::abs(axis.get(0x6064) - 100000), 90);
}

TEST(Windows, FollowingError) {  // 6065h, 6066h, statusword bit 13
  Positioning<Generic402> axis;
  axis.must(0x6065, 0, 2000);
  axis.must(0x6066, 0, 50);
  axis.must(0x605E, 0, 0);
  ASSERT_TRUE(axis.enable());
  axis.plant.lock_rotor(true);
  axis.must(0x6081, 0, 100000);
  axis.must(0x6083, 0, 100000000);
  const std::int64_t begin = axis.ticks();
  axis.give(100000);
  ASSERT_GE(axis.run_until([&] { return (axis.status() & 0x2000) != 0; }, 1000.0), 0);
  EXPECT_NEAR(static_cast<double>(axis.ticks() - begin) / 16.0, 20.0 + 50.0, 2.0);
  axis.run_ms(1);
  EXPECT_EQ(axis.get(0x603F), 0x8611);
  Positioning<Generic402> off;
  ASSERT_TRUE(off.enable());
  off.plant.lock_rotor(true);
  off.give(100000);
  off.run_ms(700);
  EXPECT_EQ(off.status() & 0x206F, 0x27);
  EXPECT_NEAR(static_cast<double>(off.get(0x60F4)), 100000.0, 1.0);
}

TEST(LimitSwitches, EndAMotionTowardsThem) {
  plant::Parameters parameters = test::default_plant();
  parameters.switches[0] = {.wire = 0, .from_counts = 100000};
  parameters.switches[1] = {.wire = 1, .to_counts = -100000};
  parameters.switch_count = 2;
  Positioning<Generic402> axis(parameters);
  axis.must(0x2030, 1, static_cast<std::int64_t>(drive::Signal::positive_limit));
  axis.must(0x2030, 2, static_cast<std::int64_t>(drive::Signal::negative_limit));
  ASSERT_TRUE(axis.enable());
  axis.give(1000000);
  ASSERT_GE(axis.run_until([&] { return axis.device.drive().axis().active(drive::Signal::positive_limit); }, 5000.0),
            0);
  const double velocity = axis.demand_velocity();
  axis.arrive();
  EXPECT_NEAR(static_cast<double>(axis.demand()), 100000.0 + velocity * velocity / 2.0 / 5242880.0, 1500.0);
  EXPECT_EQ(axis.status() & (reached | limited | 0x6F), limited | 0x27);
  EXPECT_EQ(axis.get(0x60FD) & 3, 2);
  const std::int64_t stopped = axis.demand();
  axis.give(2000000);  // further in: refused
  axis.run_ms(200);
  EXPECT_EQ(axis.demand(), stopped);
  EXPECT_EQ(axis.status() & reached, 0);
  axis.give(0);  // away: accepted
  axis.arrive();
  EXPECT_EQ(axis.demand(), 0);
  EXPECT_EQ(axis.status() & (reached | limited), reached);
  axis.give(-500000);
  axis.arrive();
  EXPECT_LT(axis.demand(), -100000);
  EXPECT_GT(axis.demand(), -130000);
}

}  // namespace
}  // namespace profile_position_test
}  // namespace servodrome
