#include "trajectory/trajectory.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>

#include "trajectory/trajectory_support.hpp"

namespace servodrome::trajectory {
namespace trajectory_test {
namespace {

using trajectory_checks::expect_sound;

constexpr MotionLimits servo{1e6, 1310720.0, 1310720.0, 1e8};  // 131072 counts/rev, 10 rev/s^2
constexpr MotionState rest{0.0, 0.0, 0.0};

TEST(LinearTrajectory, ShortMoveIsATriangle) {
  Trajectory t;
  ASSERT_EQ(t.plan_position(rest, 100000.0, 0.0, servo, RampShape::linear), Trajectory::Result::ok);
  EXPECT_NEAR(t.duration_s(), 2.0 * std::sqrt(100000.0 / 1310720.0), 1e-12);
  EXPECT_NEAR(t.duration_s(), 0.55243, 5e-5);
  const MotionState middle = t.at(t.duration_s() / 2.0);
  EXPECT_NEAR(middle.velocity, std::sqrt(100000.0 * 1310720.0), 1e-6);
  EXPECT_NEAR(middle.velocity, 362039.0, 1.0);
  EXPECT_NEAR(middle.position, 50000.0, 1e-6);
  expect_sound(t, rest, servo, RampShape::linear);
}

TEST(LinearTrajectory, LongMoveIsATrapezoid) {
  Trajectory t;
  ASSERT_EQ(t.plan_position(rest, 2000000.0, 0.0, servo, RampShape::linear), Trajectory::Result::ok);
  ASSERT_EQ(t.segments().count, 3U);
  EXPECT_NEAR(t.segments().segments[0].duration_s, 0.76294, 5e-6);
  EXPECT_NEAR(t.segments().segments[1].duration_s, 1.23706, 5e-6);
  EXPECT_NEAR(t.segments().segments[2].duration_s, 0.76294, 5e-6);
  EXPECT_EQ(t.at(1.5).velocity, 1e6);
  EXPECT_EQ(t.at(1.5).acceleration, 0.0);
}

TEST(LinearTrajectory, VelocityStep) {
  Trajectory t;
  ASSERT_EQ(t.plan_velocity({77.0, 0.0, 0.0}, 500000.0, servo, RampShape::linear), Trajectory::Result::ok);
  EXPECT_NEAR(t.duration_s(), 500000.0 / 1310720.0, 1e-12);
  EXPECT_NEAR(t.duration_s(), 0.381, 5e-4);
  const MotionState later = t.at(t.duration_s() + 2.0);
  EXPECT_EQ(later.velocity, 500000.0);
  EXPECT_EQ(later.acceleration, 0.0);
  EXPECT_NEAR(later.position, 77.0 + 250000.0 * t.duration_s() + 1e6, 1e-6);
}

TEST(LinearTrajectory, AccelerationAndDecelerationAreSeparate) {
  const MotionLimits limits{1000.0, 2000.0, 500.0, 1.0};
  Trajectory t;
  // 1000^2/2/2000 = 250 for the acceleration, 1000^2/2/500 = 1000 for the deceleration, 750 in between.
  t.plan_position(rest, -2000.0, 0.0, limits, RampShape::linear);
  EXPECT_NEAR(t.duration_s(), 0.5 + 0.75 + 2.0, 1e-12);
  EXPECT_EQ(t.at(0.25).acceleration, -2000.0);
  EXPECT_EQ(t.at(2.0).acceleration, 500.0);
}

TEST(LinearTrajectory, MovingAwayItBrakesAndComesBack) {
  const MotionLimits limits{1000.0, 2000.0, 500.0, 1.0};
  const MotionState start{10.0, -300.0, 0.0};
  Trajectory t;
  t.plan_position(start, 20.0, 0.0, limits, RampShape::linear);
  // 0.6 s and 90 counts to stop at -80, then 100 counts: peak^2 (1/4000 + 1/1000) = 100.
  const double peak = std::sqrt(100.0 / (1.0 / 4000.0 + 1.0 / 1000.0));
  EXPECT_NEAR(t.duration_s(), 0.6 + peak / 2000.0 + peak / 500.0, 1e-12);
  EXPECT_NEAR(t.at(0.6).position, -80.0, 1e-9);
  expect_sound(t, start, limits, RampShape::linear);
}

TEST(LinearTrajectory, TooFastToStopItGoesPastAndComesBack) {
  const MotionLimits limits{1000.0, 1000.0, 1000.0, 1.0};
  const MotionState start{0.0, 1000.0, 0.0};
  Trajectory t;
  t.plan_position(start, 400.0, 0.0, limits, RampShape::linear);  // stops at 500, 100 back
  EXPECT_NEAR(t.duration_s(), 1.0 + 2.0 * std::sqrt(0.1), 1e-12);
  EXPECT_EQ(t.at(10.0).position, 400.0);
}

TEST(LinearTrajectory, AboveTheVelocityLimitItDeceleratesFirst) {
  const MotionLimits limits{500.0, 1000.0, 1000.0, 1.0};
  Trajectory t;
  t.plan_position({0.0, 1000.0, 0.0}, 2000.0, 0.0, limits, RampShape::linear);
  // 375 counts in 0.5 s down to 500; 125 in 0.5 s to stop; 1500 at 500.
  EXPECT_NEAR(t.duration_s(), 0.5 + 3.0 + 0.5, 1e-12);
  EXPECT_NEAR(t.at(1.0).velocity, 500.0, 1e-9);
}

TEST(LinearTrajectory, EndVelocityIsKeptInTheDirectionOfTheApproach) {
  Trajectory t;
  for (const double target : {2000000.0, -2000000.0}) {
    ASSERT_EQ(t.plan_position(rest, target, 300000.0, servo, RampShape::linear), Trajectory::Result::ok);
    EXPECT_EQ(t.at(t.duration_s()).position, target);
    EXPECT_EQ(t.at(t.duration_s()).velocity, std::copysign(300000.0, target));
    EXPECT_NEAR(t.at(t.duration_s() + 1.0).position, target + std::copysign(300000.0, target), 1e-6);
  }
  // The sign of the end velocity has no effect.
  t.plan_position(rest, 2000000.0, -300000.0, servo, RampShape::linear);
  EXPECT_EQ(t.at(t.duration_s()).velocity, 300000.0);
}

TEST(LinearTrajectory, EndVelocityOutOfReachIsReduced) {
  Trajectory t;
  ASSERT_EQ(t.plan_position(rest, 1000.0, 300000.0, servo, RampShape::linear),
            Trajectory::Result::end_velocity_reduced);
  EXPECT_NEAR(t.at(t.duration_s()).velocity, std::sqrt(2.0 * 1310720.0 * 1000.0), 1e-6);
  EXPECT_EQ(t.at(t.duration_s()).position, 1000.0);
}

TEST(ShapedTrajectory, PeakAccelerationMeetsTheLimit) {
  struct Case {
    RampShape shape;
    double steepness;
  };
  for (const Case& c : {Case{RampShape::sin2, std::numbers::pi / 2.0}, Case{RampShape::jerk_free, 1.875}}) {
    Trajectory t;
    ASSERT_EQ(t.plan_velocity(rest, 500000.0, servo, c.shape), Trajectory::Result::ok);
    EXPECT_NEAR(t.duration_s(), c.steepness * 500000.0 / 1310720.0, 1e-12);
    const MotionState middle = t.at(t.duration_s() / 2.0);
    EXPECT_NEAR(middle.acceleration, 1310720.0, 1e-6);
    EXPECT_NEAR(middle.velocity, 250000.0, 1e-6);
    EXPECT_NEAR(t.at(t.duration_s()).position, 250000.0 * t.duration_s(), 1e-6);
    EXPECT_EQ(t.at(0.0).acceleration, 0.0);
  }
}

TEST(ShapedTrajectory, VelocityFollowsItsFormula) {
  Trajectory sin2;
  Trajectory jerk_free;
  sin2.plan_velocity({0.0, 1000.0, 0.0}, 3000.0, servo, RampShape::sin2);
  jerk_free.plan_velocity({0.0, 1000.0, 0.0}, 3000.0, servo, RampShape::jerk_free);
  for (int i = 0; i < 10; ++i) {
    const double s = i / 10.0;
    const double sine = std::sin(std::numbers::pi / 2.0 * s);
    EXPECT_NEAR(sin2.at(s * sin2.duration_s()).velocity, 1000.0 + 2000.0 * sine * sine, 1e-9);
    EXPECT_NEAR(jerk_free.at(s * jerk_free.duration_s()).velocity,
                1000.0 + 2000.0 * (10.0 * std::pow(s, 3) - 15.0 * std::pow(s, 4) + 6.0 * std::pow(s, 5)), 1e-9);
  }
}

/// Position, velocity and acceleration are each other's derivatives, to the accuracy of a central difference.
TEST(AllShapes, StatesAreConsistent) {
  const MotionLimits limits{1000.0, 3000.0, 2000.0, 20000.0};
  for (const RampShape shape : {RampShape::linear, RampShape::sin2, RampShape::jerk_free, RampShape::jerk_limited}) {
    Trajectory t;
    t.plan_position({5.0, -200.0, 0.0}, 900.0, 50.0, limits, shape);
    for (std::size_t i = 0; i < t.segments().count; ++i) {
      const TrajectorySegment& s = t.segments().segments[i];
      const double h = 1e-4 * s.duration_s;
      for (const double part : {0.1, 0.35, 0.5, 0.8}) {
        const double now = s.begin_s + part * s.duration_s;
        EXPECT_NEAR((t.at(now + h).position - t.at(now - h).position) / (2.0 * h), t.at(now).velocity, 1e-3);
        EXPECT_NEAR((t.at(now + h).velocity - t.at(now - h).velocity) / (2.0 * h), t.at(now).acceleration, 1e-2);
      }
    }
  }
}

TEST(JerkLimitedTrajectory, RestToRestShort) {
  // Neither limit is reached: four arcs, each of the cube root of d / 2 j.
  const MotionLimits limits{1e6, 1e7, 1e7, 1e8};
  Trajectory t;
  t.plan_position(rest, 1000.0, 0.0, limits, RampShape::jerk_limited);
  EXPECT_NEAR(t.duration_s(), 4.0 * std::cbrt(1000.0 / 2e8), 1e-12);
  EXPECT_EQ(t.segments().count, 3U);
  expect_sound(t, rest, limits, RampShape::jerk_limited);
}

TEST(JerkLimitedTrajectory, RestToRestLong) {
  // v/a + a/j for each ramp, cruise for the rest: T = d/v + v/a + a/j.
  const MotionLimits limits{1e5, 1e6, 1e6, 1e8};
  Trajectory t;
  t.plan_position(rest, -1e6, 0.0, limits, RampShape::jerk_limited);
  EXPECT_NEAR(t.duration_s(), 10.0 + 0.1 + 0.01, 1e-12);
  EXPECT_EQ(t.segments().count, 7U);
  expect_sound(t, rest, limits, RampShape::jerk_limited);
}

TEST(JerkLimitedTrajectory, AsymmetricRestToRest) {
  const MotionLimits limits{1e5, 1e6, 4e5, 1e8};
  Trajectory t;
  t.plan_position(rest, 1e6, 0.0, limits, RampShape::jerk_limited);
  const double rise = 0.1 + 0.01;
  const double fall = 0.25 + 0.004;
  EXPECT_NEAR(t.duration_s(), rise + fall + (1e6 - 0.5e5 * (rise + fall)) / 1e5, 1e-12);
}

TEST(JerkLimitedTrajectory, VelocityStep) {
  const MotionLimits limits{1e6, 1e6, 5e5, 1e8};
  Trajectory t;
  t.plan_velocity(rest, 2e5, limits, RampShape::jerk_limited);
  EXPECT_NEAR(t.duration_s(), 0.2 + 0.01, 1e-12);
  EXPECT_NEAR(t.at(1.0).position, 2e5 * (0.21 / 2.0 + 0.79), 1e-6);
  t.plan_velocity({0.0, 2e5, 0.0}, 0.0, limits, RampShape::jerk_limited);
  EXPECT_NEAR(t.duration_s(), 0.4 + 0.005, 1e-12);
}

TEST(JerkLimitedTrajectory, VelocityThroughZeroChangesLimit) {
  for (const MotionLimits& limits : {MotionLimits{1e6, 1e6, 5e5, 1e8}, MotionLimits{1e6, 5e5, 1e6, 1e8}}) {
    const MotionState start{0.0, -2e5, 0.0};
    Trajectory t;
    t.plan_velocity(start, 2e5, limits, RampShape::jerk_limited);
    expect_sound(t, start, limits, RampShape::jerk_limited);
    // A change of 4e5: faster than with the lower limit only, slower than with the higher limit only.
    EXPECT_LT(t.duration_s(), 0.8 + 0.005);
    EXPECT_GT(t.duration_s(), 0.4 + 0.01);
    // Arcs of a1/j at the start and a2/j at the end, 5e5/j in between; constant acceleration for the rest on either
    // side of zero: (2e5 - a^2/2j [- |a1^2 - a2^2|/2j on the side of the higher limit]) / a.
    const double high = 2e5 - 1e12 / 2e8 - 0.75e12 / 2e8;
    const double low = 2e5 - 0.25e12 / 2e8;
    EXPECT_NEAR(t.duration_s(), 0.01 + 0.005 + 0.005 + high / 1e6 + low / 5e5, 1e-12);
  }
}

TEST(JerkLimitedTrajectory, PlannedAgainOnItsWayItStaysItself) {
  const MotionLimits limits{1e5, 1e6, 4e5, 1e7};
  Trajectory t;
  t.plan_position({8e9, 0.0, 0.0}, 8e9 + 123456.0, 0.0, limits, RampShape::jerk_limited);
  for (double now = 0.0; now < t.duration_s(); now += 0.01) {
    Trajectory again;
    again.plan_position(t.at(now), 8e9 + 123456.0, 0.0, limits, RampShape::jerk_limited);
    EXPECT_NEAR(again.duration_s() + now, t.duration_s(), 1e-4 * t.duration_s()) << now;
    EXPECT_NEAR(again.at(0.02).position, t.at(now + 0.02).position, 1e-4) << now;
  }
}

TEST(AllShapes, StandingOnTheTargetIsNoMotion) {
  for (const RampShape shape : {RampShape::linear, RampShape::sin2, RampShape::jerk_free, RampShape::jerk_limited}) {
    Trajectory t;
    EXPECT_EQ(t.plan_position({42.0, 0.0, 0.0}, 42.0, 0.0, servo, shape), Trajectory::Result::ok);
    EXPECT_EQ(t.duration_s(), 0.0);
    EXPECT_EQ(t.at(0.0).position, 42.0);
    EXPECT_EQ(t.at(1.0).velocity, 0.0);
    EXPECT_EQ(t.plan_velocity({42.0, 0.0, 0.0}, 0.0, servo, shape), Trajectory::Result::ok);
    EXPECT_EQ(t.at(1.0).position, 42.0);
  }
}

TEST(AllShapes, BeforeTheStartIsTheStart) {
  for (const RampShape shape : {RampShape::linear, RampShape::sin2, RampShape::jerk_free, RampShape::jerk_limited}) {
    Trajectory t;
    t.plan_position({42.0, 10.0, 0.0}, 1000.0, 0.0, servo, shape);
    EXPECT_EQ(t.at(-1.0).position, 42.0);
    EXPECT_EQ(t.at(-1.0).velocity, 10.0);
  }
}

TEST(AllShapes, RefusesWhatIsNotANumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  Trajectory t;
  t.plan_position(rest, 1000.0, 0.0, servo, RampShape::linear);
  const double duration = t.duration_s();
  EXPECT_EQ(t.plan_position({nan, 0.0, 0.0}, 1.0, 0.0, servo, RampShape::linear), Trajectory::Result::bad_state);
  EXPECT_EQ(t.plan_position(rest, infinity, 0.0, servo, RampShape::linear), Trajectory::Result::bad_state);
  EXPECT_EQ(t.plan_velocity(rest, nan, servo, RampShape::linear), Trajectory::Result::bad_state);
  EXPECT_EQ(t.plan_position(rest, 1.0, 0.0, {0.0, 1.0, 1.0, 1.0}, RampShape::linear), Trajectory::Result::bad_limits);
  EXPECT_EQ(t.plan_position(rest, 1.0, 0.0, {1.0, -1.0, 1.0, 1.0}, RampShape::linear), Trajectory::Result::bad_limits);
  EXPECT_EQ(t.plan_velocity(rest, 1.0, {1.0, 1.0, nan, 1.0}, RampShape::linear), Trajectory::Result::bad_limits);
  EXPECT_EQ(t.plan_velocity(rest, 1.0, {1.0, 1.0, 1.0, 0.0}, RampShape::jerk_limited), Trajectory::Result::bad_limits);
  EXPECT_EQ(t.plan_velocity(rest, 1.0, {1.0, 1.0, 1.0, 0.0}, RampShape::sin2), Trajectory::Result::ok);
  t.plan_position(rest, 1000.0, 0.0, servo, RampShape::linear);
  EXPECT_EQ(t.plan_position(rest, nan, 0.0, servo, RampShape::linear), Trajectory::Result::bad_state);
  EXPECT_EQ(t.duration_s(), duration);
}

}  // namespace
}  // namespace trajectory_test
}  // namespace servodrome::trajectory
