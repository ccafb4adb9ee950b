#include <array>
#include <gtest/gtest.h>
#include <limits>

#include "drive/axis.hpp"
#include "drive/modes/set_point_follower.hpp"
#include "drive/modes/velocity_modes.hpp"

// The tests check the bounds of the software limits 607Dh and of the position range 607Bh to the count. They also check
// how the axis clips or wraps a target that lies outside.
namespace servodrome::drive {
namespace axis_limits_test {
namespace {

constexpr double endless = std::numeric_limits<double>::infinity();

struct LimitedAxis : testing::Test {
  LimitedAxis() {
    static constexpr FaultRow rows[] = {
        {Cause::position_limit, 0x8612, 0x20, Reaction::option_code, ResetRule::when_cause_gone, "position limit"}};
    policy.faults.rows = rows;
    axis.loops = &loops;
    axis.units.counts_per_revolution = 6000.0;  // 1 rpm is 100 counts/s
    objects.min_position_limit = -1000;
    objects.max_position_limit = 2000;
    objects.quick_stop_deceleration = 100000;
    axis.demand.loop = Loop::position;
  }
  void demand(Counts position, double velocity = 0.0) { axis.generator.start_from(position, velocity); }

  Objects objects{};
  Policy policy{};
  CascadeState loops{};
  Axis axis{objects, policy};
};

TEST_F(LimitedAxis, LimitsAreOffUnlessTheyAreARange) {
  EXPECT_TRUE(axis.software_limits_active());
  objects.max_position_limit = -1000;
  EXPECT_FALSE(axis.software_limits_active());
  objects.max_position_limit = -999;
  EXPECT_TRUE(axis.software_limits_active());
  constexpr auto least = std::numeric_limits<std::int32_t>::min();
  constexpr auto greatest = std::numeric_limits<std::int32_t>::max();
  for (const auto& [low, high, active] : std::to_array<std::tuple<std::int32_t, std::int32_t, bool>>(
           {{least, greatest, false}, {least, greatest - 1, true}, {least + 1, greatest, true}})) {
    objects.min_position_limit = low;
    objects.max_position_limit = high;
    EXPECT_EQ(axis.software_limits_active(), active) << low << " " << high;
    objects.min_position_range_limit = low;
    objects.max_position_range_limit = high;
    EXPECT_EQ(axis.position_range(), active ? std::int64_t{high} - low + 1 : 0);
  }
  EXPECT_FALSE(axis.software_limits_active()) << "all of a range: positions go round";
  objects.max_position_range_limit = objects.min_position_range_limit;
  policy.limits.software_needs_homing = true;
  EXPECT_FALSE(axis.software_limits_active());
  axis.homed = true;
  EXPECT_TRUE(axis.software_limits_active());
}

// A target speed above the greatest speed (here 10 rpm, 1000 counts/s) is limited, and the limitation is reported.
TEST_F(LimitedAxis, ImmediateVelocityIsClippedAtTheGreatestSpeed) {
  axis.configuration.motor.max_speed_rpm = 10.0F;
  axis.units.velocity = 1.0;
  ImmediateVelocity mode;
  for (const std::int32_t target : {0, 999, 1000, 1001, -1000, -1001}) {
    objects.target_velocity = target;
    mode.step(axis);
    EXPECT_EQ(axis.limited, target > 1000 || target < -1000) << target;
    EXPECT_EQ(axis.generator.velocity(), std::clamp(target, -1000, 1000));
  }
  mode.interrupt(axis, -1);
  mode.step(axis);
  EXPECT_EQ(axis.generator.velocity(), 0.0) << "stopped until there is another target";
  EXPECT_TRUE(axis.limited);
  objects.target_velocity = 500;
  mode.step(axis);
  EXPECT_EQ(axis.generator.velocity(), 500.0);
}

// A limit that stopped the axis (such as a limit switch) no longer applies after the mode starts again, even if its
// ramp is still locked (bit 5).
TEST_F(LimitedAxis, VelocityModeBeginsAnew) {
  VelocityMode mode;
  mode.enter(axis);
  mode.step(axis);
  mode.interrupt(axis, 1);
  mode.step(axis);
  EXPECT_TRUE(axis.limited);
  axis.controlword = 0x1F;
  mode.enter(axis);
  mode.step(axis);
  EXPECT_FALSE(axis.limited);
}

TEST_F(LimitedAxis, AtTheLimitAndBeyond) {
  struct Row {
    Counts position;
    bool low, high, beyond;
  };
  for (const auto& [position, low, high, beyond] : std::to_array<Row>({{-1001, true, false, true},
                                                                       {-1000, true, false, false},
                                                                       {-999, false, false, false},
                                                                       {1999, false, false, false},
                                                                       {2000, false, true, false},
                                                                       {2001, false, true, true}})) {
    demand(position);
    EXPECT_EQ(axis.at_limit(false), low) << position;
    EXPECT_EQ(axis.at_limit(true), high) << position;
    EXPECT_EQ(axis.at_position_limit(), low || high) << position;
    EXPECT_EQ(axis.beyond_software_limits(), beyond) << position;
    demand(0);
    axis.encoder_position = position;
    EXPECT_EQ(axis.beyond_software_limits(), beyond) << "the shaft at " << position;
    axis.encoder_position = 0;
    axis.commanded = position;
    EXPECT_EQ(axis.beyond_software_limits(), beyond) << "a target of " << position;
    axis.commanded = {};
    EXPECT_EQ(axis.within_software_limits(position), !beyond);
    // An axis with inverted polarity.
    axis.units.position_inverted = true;
    demand(-position);
    EXPECT_EQ(axis.at_limit(true), low) << position;
    EXPECT_EQ(axis.at_limit(false), high) << position;
    EXPECT_EQ(axis.within_software_limits(-position), !beyond);
    axis.units.position_inverted = false;
  }
  objects.max_position_limit = objects.min_position_limit;
  demand(5000);
  EXPECT_FALSE(axis.at_position_limit());
  EXPECT_FALSE(axis.beyond_software_limits());
  EXPECT_EQ(axis.nearest_within_software_limits(5000), 5000);
  axis.signals = bit(Signal::negative_limit);
  EXPECT_TRUE(axis.at_limit(false));
  EXPECT_FALSE(axis.at_limit(true));
  axis.signals = bit(Signal::positive_limit);
  EXPECT_FALSE(axis.at_limit(false));
  EXPECT_TRUE(axis.at_limit(true));
}

TEST_F(LimitedAxis, HeldUnlessTheDemandLeadsAway) {
  for (const double velocity : {-1.0, 0.0, 1.0}) {
    demand(2000, velocity);
    EXPECT_EQ(axis.held_by_position_limit(), velocity >= 0.0) << velocity;
    demand(-1000, velocity);
    EXPECT_EQ(axis.held_by_position_limit(), velocity <= 0.0) << velocity;
    demand(0, velocity);
    EXPECT_FALSE(axis.held_by_position_limit());
    axis.stopped_at = 1;
    EXPECT_EQ(axis.held_by_position_limit(), velocity >= 0.0) << velocity;
    axis.stopped_at = -1;
    EXPECT_EQ(axis.held_by_position_limit(), velocity <= 0.0) << velocity;
    axis.stopped_at = 0;
  }
}

TEST_F(LimitedAxis, RoomToTheLimits) {
  EXPECT_EQ(axis.room_from(500).below, 1500.0);
  EXPECT_EQ(axis.room_from(500).above, 1500.0);
  EXPECT_EQ(axis.room_from(2100).above, -100.0);
  axis.units.position_inverted = true;
  EXPECT_EQ(axis.room_from(0).below, 2000.0);
  EXPECT_EQ(axis.room_from(0).above, 1000.0);
  axis.units.position_inverted = false;
  policy.limits.target_beyond = OutOfLimits::fault;
  EXPECT_EQ(axis.kept_room_from(0).above, endless);
  EXPECT_EQ(axis.room_from(0).above, 2000.0);
  policy.limits.target_beyond = OutOfLimits::clip;
  objects.max_position_range_limit = 9999;
  EXPECT_EQ(axis.room_from(500).above, 1500.0);
  EXPECT_EQ(axis.room_from(10500).above, 1500.0) << "positions wrap";
  EXPECT_EQ(axis.room_from(-9500).above, 1500.0);
  EXPECT_EQ(axis.nearest_within_software_limits(5000), 2000);
}

// v^2 / 2a plus the distance of one cycle: 10000 counts/s, 100000 counts/s^2 and 0.5 ms give 505 counts.
TEST_F(LimitedAxis, NearWhereTheRampJustEndsBeforeTheLimit) {
  for (const int sign : {1, -1}) {
    const auto near = [&](Counts way, double deceleration) {
      demand(sign > 0 ? 2000 - way : -1000 + way, sign * 10000.0);
      return axis.near_software_limit(deceleration);
    };
    EXPECT_FALSE(near(505, 100000.0));
    EXPECT_TRUE(near(504, 100000.0));
    EXPECT_FALSE(near(5, 0.0)) << "at once: the cycle's way";
    EXPECT_TRUE(near(4, 0.0));
  }
  demand(2000, 0.0);
  EXPECT_FALSE(axis.near_software_limit(1.0)) << "it stands";
  // Outside of the position loop the position of the shaft applies.
  axis.demand.loop = Loop::velocity;
  demand(0, 10000.0);
  axis.encoder_position = 1496;
  EXPECT_TRUE(axis.near_software_limit(100000.0));
  axis.encoder_position = 1495;
  EXPECT_FALSE(axis.near_software_limit(100000.0));
}

// At 10000 counts/s and 100000 counts/s^2 the braking distance is 500 counts, and the next cycle adds 5.
TEST_F(LimitedAxis, TooFastWhereARampAfterOneCycleMoreEndsBeyondTheLimit) {
  for (const int sign : {1, -1}) {
    const auto too_fast = [&](Counts way, double deceleration) {
      demand(sign > 0 ? 2000 - way : -1000 + way, sign * 10000.0);
      return axis.too_fast_for_software_limit(deceleration);
    };
    EXPECT_FALSE(too_fast(504, 100000.0)) << "to a count, which rounding may make of it";
    EXPECT_TRUE(too_fast(503, 100000.0));
    EXPECT_FALSE(too_fast(254, 200000.0));
    EXPECT_TRUE(too_fast(253, 200000.0));
    EXPECT_FALSE(too_fast(10, 0.0)) << "without a ramp nothing can be said";
  }
  demand(2500, 0.0);
  EXPECT_FALSE(axis.too_fast_for_software_limit(100000.0));
  demand(2500, -10000.0);
  EXPECT_FALSE(axis.too_fast_for_software_limit(100000.0)) << "on its way back";
  demand(2500, 10000.0);
  EXPECT_TRUE(axis.too_fast_for_software_limit(100000.0));
  objects.max_position_range_limit = 9999;
  EXPECT_TRUE(axis.too_fast_for_software_limit(100000.0)) << "in a range as well";
}

// An axis that accelerates needs a longer braking distance after the cycle.
TEST_F(LimitedAxis, TooFastCountsTheSpeedThatTheCycleToComeAdds) {
  demand(2000 - 510, 10000.0);
  EXPECT_FALSE(axis.too_fast_for_software_limit(100000.0));
  axis.generator.run_at(1e6, {1e6, 1e6, 1e6, 1.0}, RampShape::linear);
  EXPECT_TRUE(axis.too_fast_for_software_limit(100000.0)) << "10500 counts/s, 551 counts";
}

TEST_F(LimitedAxis, PositionsWithinTheRange) {
  objects.max_position_limit = objects.min_position_limit;  // switched off
  EXPECT_EQ(axis.to_user_position(5000), 5000);
  objects.min_position_range_limit = -100;
  objects.max_position_range_limit = 259;
  EXPECT_EQ(axis.position_range(), 360);
  for (const auto& [counts, user] : std::to_array<std::pair<Counts, std::int64_t>>(
           {{-101, 259}, {-100, -100}, {259, 259}, {260, -100}, {620, -100}, {-460, -100}, {-461, 259}})) {
    EXPECT_EQ(axis.to_user_position(counts), user) << counts;
  }
  objects.max_position_range_limit = -100;
  EXPECT_EQ(axis.position_range(), 0);
  objects.max_position_range_limit = -99;
  EXPECT_EQ(axis.position_range(), 2);
  policy.limits.software_switches_range_off = true;
  EXPECT_EQ(axis.position_range(), 2);
  objects.max_position_limit = 2000;
  EXPECT_EQ(axis.position_range(), 0);
}

// ---- Cyclic targets ----

TEST_F(LimitedAxis, CyclicTargetsEndAtTheLimits) {
  struct Row {
    std::int64_t user;
    Counts target;
  };
  for (const auto& [user, target] :
       std::to_array<Row>({{-1001, -1000}, {-1000, -1000}, {0, 0}, {2000, 2000}, {2001, 2000}})) {
    axis.raised = Cause::none;
    EXPECT_EQ(resolve_cyclic_target(axis, user, 0), target);
    EXPECT_EQ(axis.limited, user != target);
    EXPECT_EQ(axis.commanded, user);
    EXPECT_EQ(axis.raised, Cause::none);
    policy.limits.target_beyond = OutOfLimits::fault;
    resolve_cyclic_target(axis, user, 0);
    EXPECT_EQ(axis.raised, user != target ? Cause::position_limit : Cause::none);
    policy.limits.target_beyond = OutOfLimits::clip;
  }
}

TEST_F(LimitedAxis, CyclicTargetsGoTheShorterWayRoundTheRange) {
  objects.max_position_limit = objects.min_position_limit;  // switched off
  objects.max_position_range_limit = 359;
  for (const auto& [user, last, target] : std::to_array<std::tuple<std::int64_t, Counts, Counts>>({{180, 0, 180},
                                                                                                   {181, 0, -179},
                                                                                                   {0, 180, 0},
                                                                                                   {0, 181, 360},
                                                                                                   {10, 350, 370},
                                                                                                   {350, 10, -10},
                                                                                                   {5, 725, 725}})) {
    EXPECT_EQ(resolve_cyclic_target(axis, user, last), target) << user << " after " << last;
  }
  // Without a range, targets wrap around at the 32-bit limits of 607Ah, relative to the present demand.
  objects.max_position_range_limit = 0;
  constexpr std::int64_t turn = std::int64_t{1} << 32;
  axis.generator.reset(turn / 2 - 1);
  EXPECT_EQ(resolve_cyclic_target(axis, -(turn / 2), 0), turn / 2);
  axis.generator.reset(3 * turn);
  EXPECT_EQ(resolve_cyclic_target(axis, 7, 0), 3 * turn + 7);
}

TEST(BridgingRate, IsTheSpeedOfTheLineLessWhatItWasSlowingDown) {
  EXPECT_EQ(bridging_rate(10.0, 10.0), 10.0);
  EXPECT_EQ(bridging_rate(10.0, 12.0), 12.0) << "as fast, not faster";
  EXPECT_EQ(bridging_rate(10.0, 8.0), 6.0) << "slowing down goes on";
  EXPECT_EQ(bridging_rate(-10.0, -8.0), -6.0);
  EXPECT_EQ(bridging_rate(10.0, 5.0), 0.0) << "down to rest";
  EXPECT_EQ(bridging_rate(10.0, 4.0), 0.0);
  EXPECT_EQ(bridging_rate(0.0, 8.0), 8.0);
  EXPECT_EQ(bridging_rate(-10.0, 8.0), 8.0) << "turned round";
}

TEST_F(LimitedAxis, AStepOfTheSpeedIsAJumpFromATenthOfTheGreatestSpeed) {
  axis.configuration.motor.max_speed_rpm = 6000.0F;  // 300 counts per cycle
  EXPECT_FALSE(LineDemand::jumps(axis, 30.0 / axis.cycle_s));
  EXPECT_TRUE(LineDemand::jumps(axis, 31.0 / axis.cycle_s));
  EXPECT_TRUE(LineDemand::jumps(axis, -31.0 / axis.cycle_s));
  axis.objects.max_motor_speed_rpm = 600;
  EXPECT_TRUE(LineDemand::jumps(axis, 4.0 / axis.cycle_s));
}

TEST_F(LimitedAxis, TargetsAreGivenUpWhereTheLimitsCameInBetween) {
  demand(0, 1000.0);
  EXPECT_FALSE(given_up_at_limits(axis, 2000));
  EXPECT_FALSE(axis.limited);
  EXPECT_TRUE(given_up_at_limits(axis, 2001));
  EXPECT_TRUE(axis.limited);
  EXPECT_FALSE(axis.generator.finished()) << "it comes to rest by the quick stop's ramp";
  EXPECT_NEAR(axis.generator.duration_s(), 1000.0 / 100000.0, 1e-9);
  policy.limits.target_beyond = OutOfLimits::fault;
  axis.raised = Cause::none;
  EXPECT_FALSE(given_up_at_limits(axis, -1001));
  EXPECT_EQ(axis.raised, Cause::position_limit);
}

// 60C2h: the value times ten to the power of the index, in cycles of 0.5 ms; the minimum is one.
TEST_F(LimitedAxis, InterpolationPeriodsInCycles) {
  InterpolationPeriod period;
  for (const auto& [value, index, cycles] :
       std::to_array<std::tuple<std::uint8_t, std::int8_t, double>>({{1, -3, 2.0},
                                                                     {20, -4, 4.0},
                                                                     {250, -6, 1.0},
                                                                     {5, -4, 1.0},
                                                                     {6, -4, 1.2},
                                                                     {1, 0, 2000.0},
                                                                     {2, 1, 40000.0},
                                                                     {255, 3, 1e6}})) {
    objects.interpolation_time_period_value = value;
    objects.interpolation_time_index = index;
    EXPECT_NEAR(period.cycles(axis), cycles, 1e-9 * cycles) << +value << " " << +index;
  }
  axis.configuration.set_point_period_s = 3e-3;
  EXPECT_NEAR(period.cycles(axis), 6.0, 1e-9) << "the drive's own instead";
  axis.configuration.set_point_period_s = 1e-6;
  EXPECT_EQ(period.cycles(axis), 1.0);
  axis.configuration.set_point_period_s = 0.0;
  objects.interpolation_time_period_value = 1;
  objects.interpolation_time_index = -3;
  EXPECT_NEAR(period.cycles(axis), 2.0, 1e-9);
}

// ---- The generator ----

TEST(Generator, PlacesAreWholeCountsAndAFraction) {
  Generator generator;
  generator.place(-5, 0.25, 3.0);
  EXPECT_EQ(generator.position(), -5);
  EXPECT_EQ(generator.fraction(), 0.25);
  EXPECT_EQ(generator.nearest_position(), -5);
  EXPECT_FALSE(generator.standing());
  generator.place(-5, -0.25, 0.0);
  EXPECT_EQ(generator.position(), -6);
  EXPECT_EQ(generator.fraction(), 0.75);
  EXPECT_EQ(generator.nearest_position(), -5);
  EXPECT_TRUE(generator.standing());
  generator.shift(100);
  EXPECT_EQ(generator.position(), 94);
}

TEST(Generator, WithoutAPlanItGoesOnAsFast) {
  Generator generator;
  generator.start_from(1000, 500.0);
  generator.step(0.25);
  EXPECT_EQ(generator.position(), 1125);
  EXPECT_EQ(generator.velocity(), 500.0);
  EXPECT_TRUE(generator.finished());
}

TEST(Generator, ARefusedPlanChangesNothing) {
  Generator generator;
  generator.reset(0);
  const MotionLimits limits{1000.0, 10000.0, 10000.0, 1.0};
  EXPECT_EQ(generator.move_to(500, 0.0, limits, RampShape::linear), Trajectory::Result::ok);
  const double duration = generator.duration_s();
  EXPECT_NEAR(duration, 0.6, 1e-9);
  EXPECT_EQ(generator.move_to(900, 0.0, {1000.0, 0.0, 0.0, 1.0}, RampShape::linear), Trajectory::Result::bad_limits);
  EXPECT_EQ(generator.run_at(100.0, {1000.0, 0.0, 0.0, 1.0}, RampShape::linear), Trajectory::Result::bad_limits);
  for (int i = 0; i < 599; ++i) generator.step(1e-3);
  EXPECT_FALSE(generator.finished());
  generator.step(1e-3);
  generator.step(1e-3);
  EXPECT_TRUE(generator.standing());
  EXPECT_EQ(generator.position(), 500);
}

// A chained motion starts exactly when the previous one ends, which may be within a cycle.
TEST(Generator, ContinuesAtTheMomentTheMotionEnded) {
  const MotionLimits limits{1000.0, 10000.0, 10000.0, 1.0};
  const double cycle_s = 7e-3;  // 0.6 s are 85.7 cycles
  Generator generator;
  generator.reset(0);
  generator.move_to(500, 0.0, limits, RampShape::linear);
  while (!generator.finished()) generator.step(cycle_s);
  generator.continue_to(1000, 0.0, limits, RampShape::linear);
  EXPECT_FALSE(generator.finished());
  int cycles = 86;
  while (!generator.finished()) {
    generator.step(cycle_s);
    ++cycles;
  }
  EXPECT_EQ(cycles, 172) << "1.2 s are 171.4 cycles";
  EXPECT_EQ(generator.position(), 1000);
  // If it comes much later, it begins immediately.
  for (int i = 0; i < 10; ++i) generator.step(cycle_s);
  generator.continue_to(1500, 0.0, limits, RampShape::linear);
  for (cycles = 0; !generator.finished(); ++cycles) generator.step(cycle_s);
  EXPECT_EQ(cycles, 86);
}

}  // namespace
}  // namespace axis_limits_test
}  // namespace servodrome::drive
