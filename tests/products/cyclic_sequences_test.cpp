#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>

#include "jmc_rig.hpp"
#include "products/ismc/ismc.hpp"
#include "reference_axis.hpp"

// Cyclic targets, and limits that change in motion, in sequences that the manuals do not show.
namespace servodrome {
namespace cyclic_sequences_test {
namespace {

using test::Reference;

// A new 607Ah every millisecond, each `step` counts after the previous one.
void stream(Reference& axis, std::int32_t& target, std::int32_t step, int milliseconds) {
  for (int i = 0; i < milliseconds; ++i) {
    axis.set(0x607A, 0, target += step);
    axis.run_ms(1);
  }
}

TEST(CyclicPosition, WaitsForTargetsThatComeTowardsIt) {
  for (const std::int64_t greatest_rpm : {1000, 6000}) {
    SCOPED_TRACE(greatest_rpm);
    Reference axis(8);
    axis.set(0x6080, 0, greatest_rpm);
    std::int32_t target = 1'000'000;
    double least = 0.0;
    for (int i = 0; i < 450; ++i) {
      stream(axis, target, -2000, 1);
      least = std::min(least, axis.turns());
    }
    for (int i = 0; i < 3000; ++i) {
      axis.run_ms(1);
      least = std::min(least, axis.turns());
    }
    EXPECT_GT(least, -0.01) << "every target was on the other side";
    EXPECT_NEAR(axis.turns(), 100'000 / 131072.0, 0.001);
  }
}

// After a pause of the targets the axis catches up by the ramps of the profile. Meanwhile the targets may stop with
// steeper ramps.
TEST(CyclicPosition, DoesNotPassALineThatEndsWhileItIsCaughtUpWith) {
  for (const int cruise_ms : {50, 150, 300, 450, 900}) {
    for (const bool lost : {false, true}) {  // lost, or late
      SCOPED_TRACE(cruise_ms);
      SCOPED_TRACE(lost);
      Reference axis(8);
      axis.set(0x6083, 0, 25 * 131072);
      axis.set(0x6084, 0, 25 * 131072);
      constexpr double most = 10 * 131.072;            // counts/ms
      constexpr double ramp = 100 * 131.072 / 1000.0;  // counts/ms^2
      constexpr auto ramp_ms = static_cast<int>(most / ramp);
      double speed = 0.0;
      double target = 0.0;
      double furthest = 0.0;
      const auto cycle = [&](bool arrives) {
        target += speed;
        if (arrives) axis.set(0x607A, 0, std::llround(target));
        axis.run_ms(1);
        furthest = std::max(furthest, axis.turns());
      };
      for (int i = 0; i < ramp_ms; ++i) speed += ramp, cycle(true);
      for (int i = 0; i < 100; ++i) cycle(true);
      for (int i = 0; i < 20; ++i) lost ? cycle(false) : axis.run_ms(1);
      for (int i = 0; i < cruise_ms; ++i) cycle(true);
      for (int i = 0; i < ramp_ms; ++i) speed -= ramp, cycle(true);
      for (int i = 0; i < 3000; ++i) axis.run_ms(1), furthest = std::max(furthest, axis.turns());
      EXPECT_LT(furthest, target / 131072.0 + 0.05);
      EXPECT_NEAR(axis.turns(), target / 131072.0, 0.001);
    }
  }
}

// Early targets slow the line of targets down more and more. The line approaches from behind the axis.
TEST(CyclicPosition, WaitsForALineWhoseTargetLiesOnTheOtherSide) {
  Reference axis(8);
  axis.set(0x607A, 0, -20'000'000);
  axis.run_ms(145);
  axis.set(0x60C2, 1, 230);
  std::int32_t target = 0;
  stream(axis, target, 0, 300);
  const double rested = axis.turns();
  ASSERT_LT(rested, -0.05);
  double least = rested;
  for (int i = 0; i < 3000; ++i) {
    stream(axis, target, 0, 1);
    least = std::min(least, axis.turns());
  }
  EXPECT_GT(least, rested - 0.01);
  EXPECT_NEAR(axis.turns(), 0.0, 0.01);
}

TEST(CyclicPosition, GoesTheShorterWayRoundFromWhereItIs) {
  Reference axis(8);
  axis.set(0x607A, 0, 2'147'483'640);
  axis.run_ms(50);
  axis.set(0x607A, 0, -260);  // nearer to the previous target by an overflow
  double furthest = axis.turns();
  for (int i = 0; i < 3000; ++i) {
    axis.run_ms(1);
    furthest = std::max(furthest, axis.turns());
  }
  EXPECT_LT(furthest, 0.5);
  EXPECT_NEAR(axis.turns(), -260 / 131072.0, 0.001);
}

// The end of a halt does not count as a command, and neither does a switch that opens.
TEST(CyclicPosition, KeepsWhatALimitHoldsThroughAHalt) {
  Reference axis(8);
  std::int32_t target = 0;
  stream(axis, target, 200, 200);
  axis.plant.force_input(0, true);
  stream(axis, target, 200, 200);
  axis.plant.force_input(0, false);
  const double held = axis.turns();
  stream(axis, target, 200, 50);
  axis.control(0x10F);
  stream(axis, target, 200, 50);
  axis.control(0x0F);
  stream(axis, target, 200, 200);
  EXPECT_NEAR(axis.turns(), held, 0.01);
  target = static_cast<std::int32_t>(std::lround((held - 0.5) * 131072.0));
  stream(axis, target, 0, 1000);
  EXPECT_NEAR(axis.turns(), held - 0.5, 0.01) << "away from it at once";
}

// The targets continue; the limit is behind the axis. The axis brakes by 6085h and returns to the limit.
TEST(CyclicPosition, BrakesByTheQuickStopsRampWhenALimitIsSetBehindIt) {
  Reference axis(8);
  axis.set(0x6085, 0, 100 * 131072);
  std::int32_t target = 0;
  for (int i = 0; i < 300; ++i) stream(axis, target, std::min(30 * 131, 26 * i), 1);
  const double there = axis.turns();
  const double speed = axis.turns_per_s();
  ASSERT_NEAR(speed, 30.0, 0.1);
  axis.limit_turns(-1.0, there - 2.0);
  double slowest_change = 0.0;
  double before = speed;
  double furthest = there;
  for (int i = 0; i < 290; ++i) {
    stream(axis, target, 30 * 131, 1);
    slowest_change = std::min(slowest_change, axis.turns_per_s() - before);
    before = axis.turns_per_s();
    furthest = std::max(furthest, axis.turns());
  }
  EXPECT_GT(slowest_change, -0.15) << "turns/s in a millisecond: the ramp has 0.1";
  EXPECT_NEAR(furthest - there, speed * speed / 200.0, 0.1);
  EXPECT_TRUE(axis.bit(11));
  EXPECT_FALSE(axis.bit(12)) << "not yet at the limit";
  stream(axis, target, 0, 3000);
  EXPECT_NEAR(axis.turns(), there - 2.0, 0.001);
}

TEST(VelocityOffset, DoesNotPushTheAxisBeyondASoftwareLimit) {
  for (const int step : {60, 131}) {  // short of the limit, and at it
    for (const std::int64_t offset : {2'000'000, 6'000'000}) {
      SCOPED_TRACE(step);
      SCOPED_TRACE(offset);
      Reference axis(8);
      axis.limit_turns(-5.0, 0.5);
      std::int32_t target = 0;
      stream(axis, target, step, 1000);
      axis.set(0x60B1, 0, offset);
      double furthest = 0.0;
      for (int i = 0; i < 500; ++i) {
        axis.run_ms(1);
        furthest = std::max(furthest, axis.turns());
      }
      EXPECT_LT(furthest, 0.505);
      EXPECT_TRUE(axis.bit(11));
      axis.set(0x60B1, 0, -2'000'000);
      axis.run_ms(500);
      EXPECT_LT(axis.turns(), 0.45) << "the other way is free";
    }
  }
}

TEST(VelocityOffset, IsLeftOutAfterASwitchUntilItHasAnotherValue) {
  Reference axis(8);
  axis.set(0x60B1, 0, 2'000'000);
  axis.run_ms(200);
  const double pushed = axis.turns();
  EXPECT_GT(pushed, 0.05) << "in the position loop it moves the axis by a following error";
  axis.plant.force_input(0, true);
  axis.run_ms(300);
  EXPECT_TRUE(axis.bit(11));
  EXPECT_LT(axis.turns(), 0.5 * pushed);
  const double held = axis.turns();
  axis.plant.force_input(0, false);
  axis.run_ms(100);
  axis.control(0x10F);
  axis.run_ms(100);
  axis.control(0x0F);
  axis.run_ms(200);
  EXPECT_NEAR(axis.turns(), held, 0.01);
  EXPECT_TRUE(axis.bit(11)) << "a limit keeps the offset out";
  axis.set(0x60B1, 0, 2'000'001);
  axis.run_ms(200);
  EXPECT_GT(axis.turns(), 0.5 * pushed);
  EXPECT_FALSE(axis.bit(11));
}

// Where the ramp of the lowered limit crosses the threshold of 8400h, the speed has a ripple around it.
TEST(MaximumMotorSpeed, LoweredInMotionIsNoOverSpeed) {
  for (std::int64_t rpm = 40; rpm <= 90; rpm += 5) {
    SCOPED_TRACE(rpm);
    Reference axis(8);
    axis.set(0x607A, 0, 600'000);
    axis.run_ms(200);
    ASSERT_GT(axis.turns_per_s(), 1.7);
    axis.set(0x6080, 0, rpm);
    axis.run_ms(600);
    EXPECT_EQ(axis.get(0x603F, 0), 0);
    EXPECT_NEAR(axis.turns_per_s() * 60.0, static_cast<double>(rpm), 3.0);
  }
}

// The targets end while the limit still decreases: the demand stands, and the shaft returns to it with a reversal of
// speed.
TEST(MaximumMotorSpeed, LoweredUnderAStreamThatEndsIsNoOverSpeed) {
  for (const int more_ms : {2, 6, 12, 20, 40}) {
    SCOPED_TRACE(more_ms);
    Reference axis(8);
    std::int32_t target = 0;
    for (std::int32_t step = 0; step < 4000; step += 50) stream(axis, target, step, 1);
    stream(axis, target, 4000, 100);
    ASSERT_NEAR(axis.turns_per_s(), 30.5, 1.0);
    axis.set(0x6080, 0, 310);
    stream(axis, target, 4000, more_ms);
    axis.run_ms(3000);
    EXPECT_EQ(axis.get(0x603F, 0), 0);
    EXPECT_NEAR(axis.turns(), target / 131072.0, 0.01);
  }
}

// ... and after the shaft rests, the lower limit is monitored.
TEST(MaximumMotorSpeed, IsWatchedOnceTheShaftHasKeptToIt) {
  Reference axis(9);
  axis.set(0x60FF, 0, 131072 * 5);
  axis.run_ms(500);
  axis.set(0x6080, 0, 60);
  axis.run_ms(2000);
  ASSERT_NEAR(axis.turns_per_s(), 1.0, 0.05);
  axis.set(0x6072, 0, 100);
  axis.plant.set_external_torque_nm(0.5);
  for (int i = 0; i < 300 && axis.get(0x603F, 0) == 0; ++i) axis.run_ms(1);
  EXPECT_EQ(axis.get(0x603F, 0), 0x8400);
}

// The loop continues without a step: the demand gets the lag that the loop has at this speed.
TEST(ModeChange, FromTheVelocityLoopKeepsTheSpeed) {
  for (const std::int64_t mode : {1, 8}) {
    SCOPED_TRACE(mode);
    Reference axis(9);
    axis.set(0x2010, 4, 0);  // without velocity feed-forward the loop has a lag
    axis.set(0x6084, 0, 131072);
    axis.set(0x60FF, 0, 131072 * 5);
    axis.run_ms(500);
    ASSERT_NEAR(axis.turns_per_s(), 5.0, 0.1);
    axis.set(0x6060, 0, mode);
    double least = 5.0;
    double greatest = 5.0;
    for (int i = 0; i < 200; ++i) {
      axis.run_ms(1);
      least = std::min(least, axis.turns_per_s());
      greatest = std::max(greatest, axis.turns_per_s());
    }
    EXPECT_GT(least, 4.65) << "0.2 s of a ramp of 1 turn/s2 take 0.2 turns/s";
    EXPECT_LT(greatest, 5.1);
  }
}

// Products that refuse targets beyond 607Dh with a fault. `rest`: the shaft's greatest place beyond the limit, turns.
template <typename RigType>
void offset_stays_within_limits(RigType& rig) {
  rig.set(0x6060, 0, 8);
  rig.set(0x6084, 0, 1'000'000'000);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(300);
  const drive::Axis& axis = rig.device.drive().axis();
  const double turn = axis.units.counts_per_revolution;
  const auto limit = axis.units.to_user(axis.position() + std::llround(0.02 * turn));
  ASSERT_EQ(rig.set(0x607D, 1, limit - axis.units.to_user(std::llround(20.0 * turn))), dictionary::AbortCode::none);
  ASSERT_EQ(rig.set(0x607D, 2, limit), dictionary::AbortCode::none);
  for (const double rpm : {300.0, 900.0}) {
    SCOPED_TRACE(rpm);
    rig.set(0x60B1, 0, std::llround(rpm / 60.0 * turn / axis.units.velocity));
    double furthest = -1e9;
    for (int i = 0; i < 1000; ++i) {
      rig.run_ms(1);
      furthest = std::max(furthest, static_cast<double>(axis.position() - axis.units.to_counts(limit)) / turn);
    }
    EXPECT_LT(furthest, 0.002);
    EXPECT_GT(furthest, -0.01) << "the offset acts up to the limit";
    EXPECT_EQ(rig.device.drive().state(), drive::PowerState::operation_enabled);
  }
}
TEST(VelocityOffset, OfTheJmcStaysWithinSoftwareLimits) {
  test::JmcRig rig;
  rig.open_limits();
  offset_stays_within_limits(rig);
}
TEST(VelocityOffset, OfTheIsmcStaysWithinSoftwareLimits) {
  test::Rig<products::Ismc> rig;
  offset_stays_within_limits(rig);
}

// A load that 60B2h (the JMC also: P02-50) holds stays where it is in stops and in other loops.
template <typename RigType, typename Change>
void load_stays(RigType& rig, double load, const Change& change) {
  const double turn = rig.device.drive().axis().units.counts_per_revolution;
  rig.plant.set_external_torque_nm(-load *
                                   static_cast<double>(rig.device.drive().configuration().motor.rated_torque_nm));
  rig.run_ms(1500);
  change();
  const auto there = static_cast<double>(rig.plant.position_counts());
  double off = 0.0;
  for (int i = 0; i < 300; ++i) {
    rig.run_ms(1);
    off = std::max(off, std::fabs(static_cast<double>(rig.plant.position_counts()) - there));
  }
  EXPECT_LT(off / turn, 2.0e-4);
}
TEST(TorqueOffset, HoldsItsLoadInStopsAndOtherModes) {
  Reference axis(8);
  axis.set(0x605A, 0, 6);
  axis.set(0x60B2, 0, 400);
  load_stays(axis, 0.4, [] {});
  const auto after = [&axis](const char* what, auto&& change) {
    SCOPED_TRACE(what);
    load_stays(axis, 0.4, change);
  };
  after("halt", [&] { axis.control(0x10F); });
  after("end of the halt", [&] { axis.control(0x0F); });
  after("profile position", [&] { axis.set(0x6060, 0, 1); });
  after("cyclic position", [&] { axis.set(0x6060, 0, 8); });
  after("profile velocity", [&] { axis.set(0x6060, 0, 3); });
  after("cyclic velocity", [&] { axis.set(0x6060, 0, 9); });
  after("quick stop", [&] { axis.control(0x0B); });
  after("enabled again", [&] { axis.control(0x0F); });
}
TEST(TorqueOffset, OfTheJmcsPanelHoldsItsLoadInOtherModes) {
  test::JmcRig rig;
  rig.open_limits();
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  ASSERT_EQ(rig.set_panel(2, 50, 300), dictionary::AbortCode::none);
  load_stays(rig, 0.3, [] {});
  for (const int mode : {3, 1, 9, 8}) {
    SCOPED_TRACE(mode);
    load_stays(rig, 0.3, [&] { rig.set(0x6060, 0, mode); });
  }
}

}  // namespace
}  // namespace cyclic_sequences_test
}  // namespace servodrome
