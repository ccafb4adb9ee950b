#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <gtest/gtest.h>
#include <random>

#include "trajectory/trajectory.hpp"

/// Properties that every trajectory must have. The checks calculate each piece with their own formulas.
namespace servodrome::trajectory::trajectory_checks {

class Random {
 public:
  explicit Random(unsigned seed) : engine_{seed} {}
  double uniform(double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<>{0.0, 1.0}(engine_);
  }
  /// Uniform in the logarithm: 10^low ... 10^high.
  double magnitude(double low, double high) { return std::pow(10.0, uniform(low, high)); }
  bool chance(double probability) { return uniform(0.0, 1.0) < probability; }
  double sign() { return chance(0.5) ? 1.0 : -1.0; }

 private:
  std::mt19937_64 engine_;
};

/// Signed velocity that is reached if the acceleration is reduced to 0 from now on.
inline double settling_velocity(const MotionState& s, double jerk) {
  return s.velocity + s.acceleration * std::abs(s.acceleration) / (2.0 * jerk);
}

/// True if the limits can be kept from this start on.
inline bool viable(const MotionState& s, const MotionLimits& l, RampShape shape) {
  if (std::abs(s.velocity) > l.velocity) return false;
  if (shape != RampShape::jerk_limited) return true;
  const double lower = std::min(l.acceleration, l.deceleration);
  const double along = s.acceleration * s.velocity;
  const double limit = along > 0.0 ? l.acceleration : along < 0.0 ? l.deceleration : lower;
  if (std::abs(s.acceleration) > limit || std::abs(settling_velocity(s, l.jerk)) > l.velocity) return false;
  const double at_standstill = s.acceleration * s.acceleration - 2.0 * l.jerk * std::abs(s.velocity);
  return along > 0.0 || at_standstill <= lower * lower;
}

struct Deviation {
  double position = 0.0, velocity = 0.0,
         acceleration = 0.0;  ///< Jumps where pieces meet, relative to the motion's extent.
  double over_velocity = 0.0, over_acceleration = 0.0, over_jerk = 0.0;  ///< Excess over the limits, relative to them.
};

/// State at the end of a piece from its definition alone.
inline MotionState end_of_piece(const TrajectorySegment& s, RampShape shape) {
  const long double t = s.duration_s;
  const long double v = s.velocity;
  const long double a = s.acceleration;
  if (shape == RampShape::sin2 || shape == RampShape::jerk_free) {
    return {static_cast<double>(s.position + t * (v + a * t / 2)), static_cast<double>(v + a * t), 0.0};
  }
  const long double j = s.jerk;
  return {static_cast<double>(s.position + t * v + t * t * a / 2 + t * t * t * j / 6),
          static_cast<double>(v + t * a + t * t * j / 2), static_cast<double>(a + t * j)};
}

inline Deviation examine(const Trajectory& trajectory, const MotionState& start, const MotionLimits& limits,
                         RampShape shape) {
  Deviation worst;
  const SegmentList& list = trajectory.segments();
  const MotionState end = trajectory.at(trajectory.duration_s());
  const bool third = shape == RampShape::jerk_limited;
  double extent = std::abs(end.position - start.position);
  double fastest = std::max(std::abs(start.velocity), std::abs(end.velocity));
  double steepest = third ? std::abs(start.acceleration) : 0.0;
  for (std::size_t i = 0; i < list.count; ++i) {
    extent = std::max(extent, std::abs(list.segments[i].position));
    fastest = std::max(fastest, std::abs(list.segments[i].velocity));
    steepest = std::max(steepest, std::abs(list.segments[i].acceleration));
  }
  const auto relative = [](double x, double scale) { return x == 0.0 ? 0.0 : std::abs(x) / scale; };
  // Positions far from 0 have this resolution. The distance is also limited by the last bit of the velocity, multiplied
  // by the stopping time, which matters for a deceleration of a count/s^2 at 10^8 counts/s.
  const double grain = 1e-15 * std::max(std::abs(start.position), std::abs(end.position)) +
                       1e-15 * fastest *
                           (fastest / std::min(limits.acceleration, limits.deceleration) +
                            (third ? std::max(limits.acceleration, limits.deceleration) / limits.jerk : 0.0));

  MotionState before{0.0, start.velocity, third ? start.acceleration : 0.0};
  EXPECT_LE(list.count, 12U);
  double time = 0.0;
  for (std::size_t i = 0; i <= list.count; ++i) {
    MotionState after{end.position - start.position, end.velocity, end.acceleration};
    if (i < list.count) {
      const TrajectorySegment& s = list.segments[i];
      after = {s.position, s.velocity, s.acceleration};
      EXPECT_NEAR(s.begin_s, time, 1e-12 * trajectory.duration_s());
      EXPECT_GT(s.duration_s, 0.0);
      time = s.begin_s + s.duration_s;
    }
    const double position_jump = std::max(std::abs(after.position - before.position) - grain, 0.0);
    worst.position = std::max(worst.position, relative(position_jump, extent));
    worst.velocity = std::max(worst.velocity, relative(after.velocity - before.velocity, fastest));
    if (third)
      worst.acceleration = std::max(worst.acceleration, relative(after.acceleration - before.acceleration, steepest));
    if (i < list.count) before = end_of_piece(list.segments[i], shape);
  }
  EXPECT_NEAR(time, trajectory.duration_s(), 1e-12 * time);

  const bool strict = viable(start, limits, shape);
  const double settled = third ? std::abs(settling_velocity(start, limits.jerk)) : 0.0;
  const double velocity_limit =
      strict ? limits.velocity : std::max({limits.velocity, std::abs(start.velocity), settled});
  for (std::size_t i = 0; i < list.count; ++i) {
    const TrajectorySegment& s = list.segments[i];
    worst.over_jerk = std::max(worst.over_jerk, third ? std::abs(s.jerk) / limits.jerk - 1.0 : 0.0);
    for (int k = 0; k <= 8; ++k) {
      const MotionState now = trajectory.at(s.begin_s + s.duration_s * k / 8.0);
      worst.over_velocity = std::max(worst.over_velocity, std::abs(now.velocity) / velocity_limit - 1.0);
      if (std::abs(now.velocity) < 1e-9 * fastest) continue;  // the sign, and therefore the limit, depends on rounding
      double limit = now.acceleration * now.velocity > 0.0 ? limits.acceleration : limits.deceleration;
      if (third && !strict) limit = std::max({limits.acceleration, limits.deceleration, std::abs(start.acceleration)});
      // At the end of a piece at() already returns values of the next piece; for a continuous acceleration they differ
      // only by rounding.
      if (!third && k == 8) continue;
      worst.over_acceleration = std::max(worst.over_acceleration, std::abs(now.acceleration) / limit - 1.0);
    }
  }
  return worst;
}

inline void expect_sound(const Trajectory& trajectory, const MotionState& start, const MotionLimits& limits,
                         RampShape shape, double tolerance = 1e-9) {
  const Deviation worst = examine(trajectory, start, limits, shape);
  EXPECT_LE(worst.position, tolerance);
  EXPECT_LE(worst.velocity, tolerance);
  EXPECT_LE(worst.acceleration, tolerance);
  EXPECT_LE(worst.over_velocity, 1e-9);
  EXPECT_LE(worst.over_acceleration, 1e-9);
  EXPECT_LE(worst.over_jerk, 1e-9);
}

}  // namespace servodrome::trajectory::trajectory_checks
