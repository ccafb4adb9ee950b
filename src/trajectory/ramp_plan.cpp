#include "trajectory/ramp_plan.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace servodrome::trajectory::ramp_plan {
namespace {

/// Appends consecutive ramps, in a frame whose positive direction is `sign`.
class RampWriter {
 public:
  RampWriter(SegmentList& list, double velocity, double sign) : list_{list}, velocity_{velocity}, sign_{sign} {}

  double position() const { return position_; }
  double velocity() const { return velocity_; }

  void ramp_to(double velocity, double slope) {
    append(std::abs(velocity - velocity_) / slope, velocity);
    velocity_ = velocity;
  }
  void cruise_for(double duration_s) { append(duration_s, velocity_); }

  /// Ramps to a velocity of the same direction, or from standstill to any velocity.
  void change_to(double velocity, const MotionLimits& limits) {
    ramp_to(velocity, std::abs(velocity) > std::abs(velocity_) ? limits.acceleration : limits.deceleration);
  }

 private:
  void append(double duration_s, double end_velocity) {
    if (!(duration_s > 0.0)) return;
    list_.segments[list_.count++] = {.begin_s = begin_s_,
                                     .duration_s = duration_s,
                                     .position = sign_ * position_,
                                     .velocity = sign_ * velocity_,
                                     .acceleration = sign_ * (end_velocity - velocity_) / duration_s,
                                     .jerk = 0.0};
    begin_s_ += duration_s;
    position_ += 0.5 * (velocity_ + end_velocity) * duration_s;
  }

  SegmentList& list_;
  double begin_s_ = 0.0;
  double position_ = 0.0;
  double velocity_;
  double sign_;
};

/// Distance of the fastest ramp from v to v1 >= 0.
double ramp_distance(double v, double v1, const MotionLimits& limits) {
  if (v < 0.0) return v1 * v1 / (2.0 * limits.acceleration) - v * v / (2.0 * limits.deceleration);
  return v1 > v ? (v1 - v) * (v1 + v) / (2.0 * limits.acceleration) : (v - v1) * (v + v1) / (2.0 * limits.deceleration);
}

}  // namespace

double steepness(RampShape shape) {
  switch (shape) {
    case RampShape::sin2: return std::numbers::pi / 2.0;
    case RampShape::jerk_free: return 15.0 / 8.0;
    case RampShape::linear:
    case RampShape::jerk_limited: break;
  }
  return 1.0;
}

Outcome to_position(SegmentList& list, double velocity, double distance, double resolution, double end_velocity,
                    const MotionLimits& limits) {
  // The axis keeps its direction of travel if it can pass the target that way, at any velocity up to the requested
  // one. Otherwise it overshoots and approaches from the other side. The comparison allows for rounding of the
  // distance.
  double sign = (velocity != 0.0 ? velocity : distance) < 0.0 ? -1.0 : 1.0;
  double v = sign * velocity;
  double way = sign * distance;
  const double nearest = ramp_distance(v, std::min(v, end_velocity), limits);
  if (way < nearest - std::max(1e-12 * std::max(nearest, std::abs(way)), resolution)) {
    sign = -sign;
    v = -v;
    way = -way;
  }

  RampWriter writer{list, v, sign};
  if (v < 0.0) writer.ramp_to(0.0, limits.deceleration);
  const double rise = 0.5 / limits.acceleration;
  const double fall = 0.5 / limits.deceleration;
  const double rest = way - writer.position();
  const double v0 = writer.velocity();
  if (end_velocity > v0 && rest < ramp_distance(v0, end_velocity, limits)) {
    const double reached = std::sqrt(v0 * v0 + std::max(rest, 0.0) / rise);
    writer.ramp_to(reached, limits.acceleration);
    return {sign * reached, true};
  }
  // rest = (peak^2 - v0^2) * rise + (peak^2 - end^2) * fall
  const double peak_squared = (rest + v0 * v0 * rise + end_velocity * end_velocity * fall) / (rise + fall);
  const double lowest_peak = std::max(v0, end_velocity);
  const double peak = std::min(std::sqrt(std::max(peak_squared, lowest_peak * lowest_peak)), limits.velocity);
  writer.change_to(peak, limits);
  if (peak == limits.velocity) {
    const double left = way - writer.position() - ramp_distance(peak, end_velocity, limits);
    writer.cruise_for(left / peak);
  }
  writer.ramp_to(end_velocity, limits.deceleration);
  return {sign * end_velocity, false};
}

void to_velocity(SegmentList& list, double velocity, double target_velocity, const MotionLimits& limits) {
  RampWriter writer{list, velocity, 1.0};
  if (velocity * target_velocity < 0.0) writer.ramp_to(0.0, limits.deceleration);
  writer.change_to(target_velocity, limits);
}

MotionState state_in(const TrajectorySegment& ramp, double t, RampShape shape) {
  const double mean = ramp.acceleration;
  const double s = t / ramp.duration_s;
  switch (shape) {
    case RampShape::sin2: {
      // v0 + dv * sin^2(pi/2 s) = v0 + dv / 2 * (1 - cos(pi s)), with dv = mean * duration
      const double angle = std::numbers::pi * s;
      const double sine = std::sin(angle);
      const double half_dv = 0.5 * mean * ramp.duration_s;
      return {ramp.position + ramp.velocity * t + half_dv * (t - ramp.duration_s * sine / std::numbers::pi),
              ramp.velocity + half_dv * (1.0 - std::cos(angle)), 0.5 * std::numbers::pi * mean * sine};
    }
    case RampShape::jerk_free: {
      const double s3 = s * s * s;
      return {
          ramp.position + ramp.velocity * t + mean * ramp.duration_s * ramp.duration_s * s3 * s * (2.5 + s * (s - 3.0)),
          ramp.velocity + mean * ramp.duration_s * s3 * (10.0 + s * (6.0 * s - 15.0)),
          30.0 * mean * s * s * (1.0 - s) * (1.0 - s)};
    }
    case RampShape::linear:
    case RampShape::jerk_limited: break;
  }
  return {ramp.position + t * (ramp.velocity + t * (ramp.acceleration / 2.0 + t * ramp.jerk / 6.0)),
          ramp.velocity + t * (ramp.acceleration + t * ramp.jerk / 2.0), ramp.acceleration + t * ramp.jerk};
}

}  // namespace servodrome::trajectory::ramp_plan
