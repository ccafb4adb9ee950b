#include "drive/modes/line_demand.hpp"

#include <gtest/gtest.h>
#include <vector>

// The demand while it approaches a line of cyclic set-points, cycle by cycle.
namespace servodrome::drive {
namespace line_demand_test {
namespace {

struct Demand : testing::Test {
  Demand() {
    axis.loops = &loops;
    axis.units.counts_per_revolution = 6000.0;  // 1 rpm is 100 counts/s
    axis.greatest_velocity = 120'000.0;
    objects.profile_acceleration = objects.profile_deceleration = 100'000'000;
  }
  // Advances one cycle of a line that stands or moves; returns the distance of the demand.
  double follow(bool moves = false) {
    const double before = place();
    demand.follow(axis, line, [&] {
      line.step(moves);
      return moves;
    });
    return place() - before;
  }
  double place() const { return static_cast<double>(axis.generator.position()) + axis.generator.fraction(); }

  Objects objects{};
  Policy policy{};
  CascadeState loops{};
  Axis axis{objects, policy};
  Line line{};
  LineDemand demand{};
};

// The distance of each cycle is the mean of its speeds; also in the cycle in which the greatest speed is reached after
// two fifths of the cycle.
TEST_F(Demand, CatchesUpByItsRampsWithoutAStep) {
  for (const int sign : {1, -1}) {
    axis.generator.reset(0);
    demand.stop();
    line.stand(0);
    demand.begin(axis, line, sign * 1000, 1.0);
    EXPECT_FALSE(demand.on_line()) << "1000 counts in half a millisecond";
    const double a = 1.0e8, v = 1.2e5, t = axis.cycle_s;
    EXPECT_NEAR(follow(), sign * 0.5 * a * t * t, 1e-6);
    EXPECT_NEAR(follow(), sign * 1.5 * a * t * t, 1e-6);
    EXPECT_NEAR(axis.generator.velocity(), sign * 1.0e5, 1e-6);
    EXPECT_NEAR(follow(), sign * (v * t - 0.5 * (v - 1.0e5) * (v - 1.0e5) / a), 1e-6);
    EXPECT_NEAR(follow(), sign * v * t, 1e-6);
    EXPECT_NEAR(axis.generator.velocity(), sign * v, 1e-6);
    int cycles = 4;
    for (; !demand.on_line() && cycles < 1000; ++cycles) follow();
    // 1000 counts at 120000 counts/s, with half a ramp at each end: 8.33 ms and 1.2 ms.
    EXPECT_EQ(cycles, 20);
    EXPECT_EQ(place(), sign * 1000.0);
    EXPECT_EQ(axis.generator.velocity(), 0.0);
  }
}

TEST_F(Demand, IsTheLineWhereThatBegins) {
  axis.generator.reset(500);
  line.stand(500);
  demand.begin(axis, line, 510, 1.0);
  EXPECT_TRUE(demand.on_line()) << "20000 counts/s are no jump";
  line.go(510, 4.0);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(follow(true), 2.5, 1e-9);
  EXPECT_NEAR(axis.generator.velocity(), 2.5 / axis.cycle_s, 1e-6);
}

// After a limit the demand stands until the line leads away from the limit. It then approaches the line by its ramps,
// at any distance.
TEST_F(Demand, HeldAtALimitUntilTheLineLeadsAway) {
  objects.profile_acceleration = objects.profile_deceleration = 1'000'000;
  for (const int sign : {1, -1}) {
    axis.generator.reset(0);
    demand.hold(sign);
    EXPECT_FALSE(demand.on_line());
    line.stand(sign * 10);
    axis.limited = false;
    EXPECT_EQ(follow(), 0.0);
    EXPECT_TRUE(axis.limited) << "beyond the limit";
    EXPECT_FALSE(demand.on_line());
    line.stand(-sign * 10);
    axis.limited = false;
    EXPECT_NEAR(follow(), -sign * 0.125, 1e-6) << "half of 1e6 counts/s^2 for half a millisecond squared";
    EXPECT_FALSE(axis.limited);
    EXPECT_FALSE(demand.on_line());
    for (int i = 0; i < 20; ++i) follow();
    EXPECT_TRUE(demand.on_line());
    EXPECT_EQ(place(), -sign * 10.0);
  }
}

// Before a software limit the demand stops with the quick stop's ramp if that is steeper.
TEST_F(Demand, CatchesUpBeforeASoftwareLimit) {
  objects.profile_acceleration = 10'000'000;
  objects.profile_deceleration = 1'000'000;
  objects.quick_stop_deceleration = 10'000'000;
  objects.min_position_limit = -100'000;
  objects.max_position_limit = 2000;
  axis.demand.loop = Loop::position;
  // From 100000 counts/s one ramp stops after 500 counts, the other after 5000.
  for (const bool near : {true, false}) {
    objects.max_position_limit = near ? 700 : 100'000;
    axis.generator.start_from(0, 100'000.0);
    demand.stop();
    line.stand(0);
    demand.begin(axis, line, near ? 700 : 9000, 1.0);
    double steepest = 0.0;
    Counts farthest = 0;
    for (int i = 0; i < 400 && !demand.on_line(); ++i) {
      const double before = axis.generator.velocity();
      follow();
      steepest = std::max(steepest, (before - axis.generator.velocity()) / axis.cycle_s);
      farthest = std::max(farthest, axis.generator.position());
    }
    EXPECT_TRUE(demand.on_line());
    EXPECT_EQ(place(), near ? 700.0 : 9000.0);
    EXPECT_LE(farthest, near ? 700 : 9000);
    if (near) {
      EXPECT_GT(steepest, 5.0e6);
      EXPECT_LE(steepest, 1.001e7);
    } else {
      EXPECT_LE(steepest, 1.001e6);
    }
  }
}

// The axis follows a line that is too fast at its greatest speed, and catches up afterwards.
TEST_F(Demand, NoFasterThanTheAxisMayBe) {
  axis.generator.start_from(0, axis.greatest_velocity);
  line.stand(0);
  demand.begin(axis, line, 60, 1.0);
  line.go(600, 10.0);  // 60 counts per cycle: the greatest speed
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(follow(true), 60.0, 1e-6);
  EXPECT_FALSE(axis.velocity_clipped);
  EXPECT_TRUE(demand.on_line());
  line.go(line.now() + 610, 10.0);
  axis.velocity_clipped = false;
  EXPECT_NEAR(follow(true), 60.0, 1e-6);
  EXPECT_TRUE(axis.velocity_clipped);
  EXPECT_FALSE(demand.on_line());
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(follow(true), 60.0, 1e-6);
  EXPECT_NEAR(static_cast<double>(line.now()) + line.fraction() - place(), 10.0, 1e-6);
  for (int i = 0; i < 20; ++i) follow();
  EXPECT_TRUE(demand.on_line());
  EXPECT_EQ(place(), 910.0);
}

}  // namespace
}  // namespace line_demand_test
}  // namespace servodrome::drive
