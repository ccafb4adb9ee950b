// Plans that start on another plan: the state of a drive when a new set-point arrives. Each plan is checked for
// validity and compared with a brute-force optimum that shares no code or formula with the planner.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>

#include "draws.hpp"
#include "trajectory/trajectory.hpp"
#include "trajectory/trajectory_support.hpp"

namespace servodrome::trajectory {
namespace trajectory_replan_test {
namespace {

using trajectory_checks::Deviation;
using trajectory_checks::examine;
using trajectory_checks::Random;
using trajectory_checks::settling_velocity;
using trajectory_checks::viable;

using Real = long double;

struct Travel {
  Real time = 0.0L;
  Real distance = 0.0L;
  Travel operator+(const Travel& other) const { return {time + other.time, distance + other.distance}; }
  Travel mirrored() const { return {time, -distance}; }
};

/// The highest parameter in [low, high] whose motion does not exceed `way`.
template <class Motion>
Real bisect(Real low, Real high, Real way, Motion motion) {
  for (int i = 0; i < 60; ++i) {
    const Real middle = (low + high) / 2;
    (motion(middle).distance <= way ? low : high) = middle;
  }
  return low;
}

/// --- Second order: the velocity changes with the maximum acceleration and deceleration. ---

Travel linear_ramp(Real from, Real to, const MotionLimits& l) {
  if (from * to < 0) return linear_ramp(from, 0, l) + linear_ramp(0, to, l);
  const Real slope = std::abs(to) > std::abs(from) ? l.acceleration : l.deceleration;
  const Real time = std::abs(to - from) / slope;
  return {time, time * (from + to) / 2};
}

/// The optimum changes to some velocity, keeps it if it is the limit, and then changes to 0; the distance increases
/// with that velocity.
Real shortest_linear(Real velocity, Real way, const MotionLimits& l) {
  const auto over = [&](Real peak) { return linear_ramp(velocity, peak, l) + linear_ramp(peak, 0, l); };
  const Real limit = l.velocity;
  for (const Real extreme : {limit, -limit}) {
    const Travel fastest = over(extreme);
    const Real left = way - fastest.distance;
    if (left * extreme >= 0) return fastest.time + left / extreme;
  }
  return over(bisect(-limit, limit, way, over)).time;
}

/// --- Third order. ---

struct State {
  Real velocity;
  Real acceleration;
};

Travel arc(State& s, Real jerk, Real time) {
  const Travel travel{time, s.velocity * time + s.acceleration * time * time / 2 + jerk * time * time * time / 6};
  s.velocity += s.acceleration * time + jerk * time * time / 2;
  s.acceleration += jerk * time;
  return travel;
}

/// Changes to a velocity above the settling velocity, by bisection over the highest acceleration.
Travel ramp_up(State s, Real to, Real cap, Real jerk) {
  const auto with_peak = [&](Real peak, State& at, Real hold) {
    Travel travel = arc(at, peak >= at.acceleration ? jerk : -jerk, std::abs(peak - at.acceleration) / jerk);
    travel = travel + arc(at, 0, hold);
    return travel + arc(at, -jerk, at.acceleration / jerk);
  };
  Real low = std::max<Real>(s.acceleration, 0);
  Real high = std::max(cap, low);
  State at_cap = s;
  with_peak(high, at_cap, 0);
  if (at_cap.velocity <= to) {
    State end = s;
    return with_peak(high, end, (to - at_cap.velocity) / high);
  }
  // Two arcs from 0 to a and back give a^2/j: this is enough even for the whole difference.
  high = std::min(high, low + std::sqrt(std::max<Real>(to - s.velocity, 0) * jerk) + std::abs(s.acceleration));
  for (int i = 0; i < 50; ++i) {
    const Real middle = (low + high) / 2;
    State end = s;
    with_peak(middle, end, 0);
    (end.velocity <= to ? low : high) = middle;
  }
  State end = s;
  return with_peak(low, end, 0);
}

/// Changes to any velocity, in one direction of motion or with equal limits.
Travel ramp(State s, Real to, const MotionLimits& l) {
  const Real jerk = l.jerk;
  const Real settled = s.velocity + s.acceleration * std::abs(s.acceleration) / (2 * jerk);
  if (to >= settled) return ramp_up(s, to, l.acceleration, jerk);
  return ramp_up({-s.velocity, -s.acceleration}, -to, l.deceleration, jerk).mirrored();
}

/// The optimum for a start within the limits, with equal limits or (with `way` ahead of the axis, which moves towards
/// it) in one direction. The axis increases its velocity and reduces it again; or, if it already brakes, it brakes less
/// for some time and then fully.
Real shortest_third(State s, Real way, const MotionLimits& l) {
  const Travel stop = ramp(s, 0, l);
  if (way < stop.distance) return shortest_third({-s.velocity, -s.acceleration}, -way, l);
  const Real settled = s.velocity + s.acceleration * std::abs(s.acceleration) / (2 * static_cast<Real>(l.jerk));
  const auto over = [&](Real peak) { return ramp(s, peak, l) + ramp({peak, 0}, 0, l); };
  const Real lowest = std::max<Real>(settled, 0);
  if (way >= over(lowest).distance) {
    const Real limit = l.velocity;
    const Travel fastest = over(limit);
    if (way >= fastest.distance) return fastest.time + (way - fastest.distance) / limit;
    return over(bisect(lowest, limit, way, over)).time;
  }
  const auto braking_less = [&](Real until) {
    State now = s;
    const Travel first = arc(now, l.jerk, (until - s.acceleration) / l.jerk);
    return first + ramp(now, 0, l);
  };
  return braking_less(bisect(s.acceleration, 0, way, braking_less)).time;
}

/// --- Test runs. ---

struct Tally {
  Deviation worst;
  double end_error = 0.0;  ///< Of at(duration) against target and end velocity, relative to the distance or limit.
  double slower = 0.0;     ///< Than the reference, relative.
  double faster = 0.0;     // Faster than the reference, relative: one of the two is wrong.
  int compared = 0;
  int strict = 0;

  void add(const Deviation& d) {
    worst.position = std::max(worst.position, d.position);
    worst.velocity = std::max(worst.velocity, d.velocity);
    worst.acceleration = std::max(worst.acceleration, d.acceleration);
    worst.over_velocity = std::max(worst.over_velocity, d.over_velocity);
    worst.over_acceleration = std::max(worst.over_acceleration, d.over_acceleration);
    worst.over_jerk = std::max(worst.over_jerk, d.over_jerk);
  }
  void compare(double duration, Real reference) {
    ++compared;
    const double difference = static_cast<double>((duration - reference) / std::max(reference, Real{1e-12L}));
    slower = std::max(slower, difference);
    faster = std::max(faster, -difference);
  }
  void expect_good(const char* what) const {
    std::printf(
        "%s: jumps p %.1e v %.1e a %.1e; over v %.1e a %.1e j %.1e; %d strict; %d compared, slower %.1e faster %.1e\n",
        what, worst.position, worst.velocity, worst.acceleration, worst.over_velocity, worst.over_acceleration,
        worst.over_jerk, strict, compared, slower, faster);
    EXPECT_LE(worst.position, 1e-9);
    EXPECT_LE(worst.velocity, 1e-9);
    EXPECT_LE(worst.acceleration, 1e-9);
    EXPECT_LE(worst.over_velocity, 1e-9);
    EXPECT_LE(worst.over_acceleration, 1e-9);
    EXPECT_LE(worst.over_jerk, 1e-9);
    EXPECT_LE(end_error, 1e-9);
    EXPECT_LE(slower, 1e-6);
    EXPECT_LE(faster, 1e-6);
  }
};

/// How the limits are drawn at random.
enum class Symmetry { equal, separate };

MotionLimits draw_limits(Random& random, Symmetry symmetry) {
  MotionLimits l{};
  l.velocity = random.magnitude(4.0, 7.0);
  l.acceleration = l.velocity * random.magnitude(-0.5, 2.0);
  l.deceleration = symmetry == Symmetry::equal ? l.acceleration : l.acceleration * random.magnitude(-1.0, 1.0);
  l.jerk = l.acceleration * random.magnitude(0.0, 3.0);
  return l;
}

const int plans = servodrome::test::draws(100'000);
constexpr double travel_range = 8589934592.0;  // 2^33 counts

/// A chain of plans, each of which starts at a random time of the previous one; calls `examined(start, target, limits,
/// trajectory)` for each.
template <class Examined>
void run_chain(unsigned seed, RampShape shape, Symmetry symmetry, double with_end_velocity, Examined examined) {
  Random random{seed};
  MotionLimits limits = draw_limits(random, symmetry);
  MotionState start{0.0, 0.0, 0.0};
  Trajectory trajectory;
  for (int i = 0; i < plans; ++i) {
    if (random.chance(0.3)) limits = draw_limits(random, symmetry);
    if (random.chance(0.02) || std::abs(start.position) > travel_range) {
      start = {random.uniform(-0.5, 0.5) * travel_range, 0.0, 0.0};
    }
    // From a count to a few seconds of travel.
    const double span = random.magnitude(0.0, std::log10(limits.velocity) + 0.7);
    const double target =
        start.position + (random.chance(0.5) ? std::round(random.sign() * span) : random.sign() * span);
    const double end_velocity = random.chance(with_end_velocity) ? random.uniform(0.0, 1.1) * limits.velocity : 0.0;
    const Trajectory::Result result = trajectory.plan_position(start, target, end_velocity, limits, shape);
    ASSERT_TRUE(result == Trajectory::Result::ok ||
                (end_velocity > 0.0 && result == Trajectory::Result::end_velocity_reduced));
    examined(start, target, std::min(end_velocity, limits.velocity), limits, trajectory, result);
    if (::testing::Test::HasFatalFailure()) return;
    start = trajectory.at(random.uniform(0.0, 1.05) * trajectory.duration_s());
  }
}

void examine_plan(Tally& tally, const MotionState& start, double target, double end_velocity,
                  const MotionLimits& limits, const Trajectory& trajectory, Trajectory::Result result,
                  RampShape shape) {
  tally.add(examine(trajectory, start, limits, shape));
  tally.strict += viable(start, limits, shape) ? 1 : 0;
  const MotionState end = trajectory.at(trajectory.duration_s());
  tally.end_error = std::max(tally.end_error, std::abs(end.position - target));
  tally.end_error = std::max(tally.end_error, std::abs(end.acceleration));
  if (result == Trajectory::Result::ok) {
    tally.end_error = std::max(tally.end_error, std::abs(std::abs(end.velocity) - end_velocity) / limits.velocity);
  } else {
    EXPECT_LT(std::abs(end.velocity), end_velocity * (1.0 + 1e-12));
  }
}

TEST(LinearReplan, SoundAndTimeOptimal) {
  Tally tally;
  run_chain(1, RampShape::linear, Symmetry::separate, 0.0,
            [&](const MotionState& start, double target, double end_velocity, const MotionLimits& limits,
                const Trajectory& trajectory, Trajectory::Result result) {
              examine_plan(tally, start, target, end_velocity, limits, trajectory, result, RampShape::linear);
              tally.compare(trajectory.duration_s(),
                            shortest_linear(start.velocity, Real{target} - start.position, limits));
            });
  tally.expect_good("linear");
  EXPECT_EQ(tally.compared, plans);
}

TEST(JerkLimitedReplan, SoundAndTimeOptimalWithEqualLimits) {
  Tally tally;
  run_chain(2, RampShape::jerk_limited, Symmetry::equal, 0.0,
            [&](const MotionState& start, double target, double end_velocity, const MotionLimits& limits,
                const Trajectory& trajectory, Trajectory::Result result) {
              examine_plan(tally, start, target, end_velocity, limits, trajectory, result, RampShape::jerk_limited);
              if (!viable(start, limits, RampShape::jerk_limited)) return;
              tally.compare(trajectory.duration_s(), shortest_third({start.velocity, start.acceleration},
                                                                    Real{target} - start.position, limits));
            });
  tally.expect_good("jerk-limited, acceleration = deceleration");
  EXPECT_GT(tally.compared, plans / 2);
}

TEST(JerkLimitedReplan, SoundWithSeparateLimitsAndOptimalInOneDirection) {
  Tally tally;
  run_chain(3, RampShape::jerk_limited, Symmetry::separate, 0.0,
            [&](const MotionState& start, double target, double end_velocity, const MotionLimits& limits,
                const Trajectory& trajectory, Trajectory::Result result) {
              examine_plan(tally, start, target, end_velocity, limits, trajectory, result, RampShape::jerk_limited);
              if (!viable(start, limits, RampShape::jerk_limited)) return;
              const double ahead = target > start.position ? 1.0 : -1.0;
              const State state{ahead * start.velocity, ahead * start.acceleration};
              const Real way = std::abs(Real{target} - start.position);
              const bool one_direction = state.velocity >= 0.0L &&
                                         ahead * settling_velocity(start, limits.jerk) >= 0.0 &&
                                         way >= ramp(state, 0, limits).distance;
              if (one_direction) tally.compare(trajectory.duration_s(), shortest_third(state, way, limits));
            });
  tally.expect_good("jerk-limited, acceleration != deceleration");
  EXPECT_GT(tally.compared, plans / 10);
}

/// With a reversal the optimum for separate limits is not known; it is between those for equal limits.
TEST(JerkLimitedReplan, SeparateLimitsLieBetweenEqualOnes) {
  Random random{4};
  int reversals = 0;
  for (int i = 0; i < plans; ++i) {
    const MotionLimits limits = draw_limits(random, Symmetry::separate);
    MotionLimits slow = limits;
    MotionLimits fast = limits;
    slow.acceleration = slow.deceleration = std::min(limits.acceleration, limits.deceleration);
    fast.acceleration = fast.deceleration = std::max(limits.acceleration, limits.deceleration);
    const MotionState start{0.0, random.uniform(-1.0, 1.0) * limits.velocity,
                            random.uniform(-1.0, 1.0) * slow.acceleration};
    if (!viable(start, slow, RampShape::jerk_limited)) continue;
    const double target = random.sign() * random.magnitude(0.0, std::log10(limits.velocity) + 0.7);
    Trajectory planned;
    Trajectory slower;
    Trajectory faster;
    planned.plan_position(start, target, 0.0, limits, RampShape::jerk_limited);
    slower.plan_position(start, target, 0.0, slow, RampShape::jerk_limited);
    faster.plan_position(start, target, 0.0, fast, RampShape::jerk_limited);
    const bool reversal = planned.at(0.0).velocity * (target - start.position) < 0.0;
    reversals += reversal ? 1 : 0;
    ASSERT_GE(planned.duration_s(), faster.duration_s() * (1.0 - 1e-9));
    ASSERT_LE(planned.duration_s(), slower.duration_s() * (1.0 + 1e-9)) << i;
  }
  EXPECT_GT(reversals, plans / 5);
}

TEST(AllShapesReplan, SoundWithEndVelocities) {
  for (const RampShape shape : {RampShape::linear, RampShape::sin2, RampShape::jerk_free, RampShape::jerk_limited}) {
    Tally tally;
    int reduced = 0;
    run_chain(5, shape, Symmetry::separate, 0.8,
              [&](const MotionState& start, double target, double end_velocity, const MotionLimits& limits,
                  const Trajectory& trajectory, Trajectory::Result result) {
                examine_plan(tally, start, target, end_velocity, limits, trajectory, result, shape);
                reduced += result == Trajectory::Result::end_velocity_reduced ? 1 : 0;
              });
    tally.expect_good("with end velocities");
    EXPECT_GT(reduced, 1000);
  }
}

/// Also with starts far outside the limits, as in a drive whose limits were lowered.
TEST(JerkLimitedReplan, SoundFromAnyState) {
  Random random{8};
  Tally tally;
  for (int i = 0; i < plans; ++i) {
    const MotionLimits limits = draw_limits(random, random.chance(0.2) ? Symmetry::equal : Symmetry::separate);
    const MotionState start{0.0, random.uniform(-2.0, 2.0) * limits.velocity,
                            random.uniform(-2.0, 2.0) * limits.acceleration};
    const double target = random.sign() * random.magnitude(0.0, 7.0);
    const double end_velocity = random.chance(0.5) ? 0.0 : random.uniform(0.0, 1.0) * limits.velocity;
    Trajectory trajectory;
    const Trajectory::Result result =
        trajectory.plan_position(start, target, end_velocity, limits, RampShape::jerk_limited);
    examine_plan(tally, start, target, end_velocity, limits, trajectory, result, RampShape::jerk_limited);
  }
  tally.expect_good("from any state");
  EXPECT_GT(tally.strict, 1000);
}

TEST(AllShapesReplan, VelocityModeIsSound) {
  for (const RampShape shape : {RampShape::linear, RampShape::sin2, RampShape::jerk_free, RampShape::jerk_limited}) {
    Random random{6};
    Tally tally;
    MotionState start{0.0, 0.0, 0.0};
    Trajectory trajectory;
    for (int i = 0; i < plans; ++i) {
      const Symmetry symmetry = random.chance(0.5) ? Symmetry::equal : Symmetry::separate;
      const MotionLimits limits = draw_limits(random, symmetry);
      const double target = random.chance(0.1) ? 0.0 : random.uniform(-1.2, 1.2) * limits.velocity;
      start.position = 0.0;
      ASSERT_EQ(trajectory.plan_velocity(start, target, limits, shape), Trajectory::Result::ok);
      tally.add(examine(trajectory, start, limits, shape));
      EXPECT_EQ(trajectory.at(trajectory.duration_s() * 2.0 + 1.0).velocity,
                std::clamp(target, -limits.velocity, limits.velocity));
      if (shape == RampShape::jerk_limited && symmetry == Symmetry::equal) {
        const State state{start.velocity, start.acceleration};
        if (viable(start, limits, shape)) {
          tally.compare(trajectory.duration_s(),
                        ramp(state, std::clamp(target, -limits.velocity, limits.velocity), limits).time);
        }
      }
      start = trajectory.at(random.uniform(0.0, 1.05) * trajectory.duration_s());
    }
    tally.expect_good("velocity mode");
  }
}

/// Values of every magnitude that a drive can receive, in any combination.
TEST(AllShapesReplan, SoundInEveryMagnitude) {
  for (const RampShape shape : {RampShape::linear, RampShape::sin2, RampShape::jerk_free, RampShape::jerk_limited}) {
    Random random{7};
    Tally tally;
    for (int i = 0; i < plans; ++i) {
      const MotionLimits limits{random.magnitude(0.0, 8.0), random.magnitude(0.0, 11.0), random.magnitude(0.0, 11.0),
                                random.magnitude(0.0, 14.0)};
      MotionState start{0.0, 0.0, 0.0};
      if (random.chance(0.5)) {
        start.velocity = random.sign() * random.magnitude(0.0, 8.0);
        start.acceleration = random.sign() * random.magnitude(0.0, 11.0);
        if (random.chance(0.8) && !viable(start, limits, shape)) continue;
      }
      const double target = random.chance(0.1) ? 1.0 : random.sign() * random.magnitude(0.0, 9.93);
      const double end_velocity = random.chance(0.7) ? 0.0 : random.magnitude(0.0, 8.0);
      Trajectory trajectory;
      const Trajectory::Result result = trajectory.plan_position(start, target, end_velocity, limits, shape);
      examine_plan(tally, start, target, std::min(end_velocity, limits.velocity), limits, trajectory, result, shape);
      if (shape == RampShape::jerk_limited && start.velocity == 0.0 && start.acceleration == 0.0 &&
          end_velocity == 0.0) {
        tally.compare(trajectory.duration_s(), shortest_third({0, 0}, std::abs(target), limits));
      } else if (shape == RampShape::linear && end_velocity == 0.0) {
        tally.compare(trajectory.duration_s(), shortest_linear(start.velocity, target, limits));
      }
    }
    tally.expect_good("every magnitude");
  }
}

}  // namespace
}  // namespace trajectory_replan_test
}  // namespace servodrome::trajectory
