#include "trajectory/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "trajectory/ramp_plan.hpp"
#include "trajectory/third_order_plan.hpp"

namespace servodrome::trajectory {
namespace {

bool finite(const MotionState& state) {
  return std::isfinite(state.position) && std::isfinite(state.velocity) && std::isfinite(state.acceleration);
}

bool valid(double limit) { return std::isfinite(limit) && limit > 0.0; }

bool valid(const MotionLimits& limits, RampShape shape) {
  return valid(limits.velocity) && valid(limits.acceleration) && valid(limits.deceleration) &&
         (shape != RampShape::jerk_limited || valid(limits.jerk));
}

/// Limits of the mean slope of a ramp, so that its greatest slope meets `limits`.
MotionLimits mean_limits(MotionLimits limits, RampShape shape) {
  const double steepness = ramp_plan::steepness(shape);
  limits.acceleration /= steepness;
  limits.deceleration /= steepness;
  return limits;
}

double end_of(const SegmentList& list) {
  if (list.count == 0) return 0.0;
  const TrajectorySegment& last = list.segments[list.count - 1];
  return last.begin_s + last.duration_s;
}

}  // namespace

Trajectory::Result Trajectory::plan_position(const MotionState& start, double target, double end_velocity,
                                             const MotionLimits& limits, RampShape shape) {
  if (!finite(start) || !std::isfinite(target) || !std::isfinite(end_velocity)) return Result::bad_state;
  if (!valid(limits, shape)) return Result::bad_limits;
  const double distance = target - start.position;
  const double passing = std::min(std::abs(end_velocity), limits.velocity);
  // A start taken from a running trajectory is rounded to the resolution of its position.
  const double resolution =
      2.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(target), std::abs(start.position));
  list_.count = 0;
  const ramp_plan::Outcome outcome =
      shape == RampShape::jerk_limited
          ? third_order_plan::to_position(list_, start, distance, resolution, passing, limits)
          : ramp_plan::to_position(list_, start.velocity, distance, resolution, passing, mean_limits(limits, shape));
  shape_ = shape;
  duration_s_ = end_of(list_);
  base_ = start.position;
  end_ = {target, outcome.end_velocity, 0.0};
  return outcome.reduced ? Result::end_velocity_reduced : Result::ok;
}

Trajectory::Result Trajectory::plan_velocity(const MotionState& start, double target_velocity,
                                             const MotionLimits& limits, RampShape shape) {
  if (!finite(start) || !std::isfinite(target_velocity)) return Result::bad_state;
  if (!valid(limits, shape)) return Result::bad_limits;
  const double velocity = std::clamp(target_velocity, -limits.velocity, limits.velocity);
  list_.count = 0;
  if (shape == RampShape::jerk_limited) {
    third_order_plan::to_velocity(list_, start, velocity, limits);
  } else {
    ramp_plan::to_velocity(list_, start.velocity, velocity, mean_limits(limits, shape));
  }
  shape_ = shape;
  duration_s_ = end_of(list_);
  base_ = start.position;
  end_ = {start.position, velocity, 0.0};
  if (list_.count > 0) {
    const TrajectorySegment& last = list_.segments[list_.count - 1];
    end_.position += ramp_plan::state_in(last, last.duration_s, shape).position;
  }
  return Result::ok;
}

MotionState Trajectory::at(double seconds_since_plan) const {
  const double t = std::max(seconds_since_plan, 0.0);
  if (t >= duration_s_) return {end_.position + (t - duration_s_) * end_.velocity, end_.velocity, 0.0};
  std::size_t index = list_.count - 1;
  while (index > 0 && list_.segments[index].begin_s > t) --index;
  const TrajectorySegment& segment = list_.segments[index];
  MotionState state = ramp_plan::state_in(segment, t - segment.begin_s, shape_);
  state.position += base_;
  return state;
}

}  // namespace servodrome::trajectory
