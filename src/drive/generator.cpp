#include "drive/generator.hpp"

namespace servodrome::drive {

void Generator::start_from(Counts position, double velocity) { place(position, 0.0, velocity); }

void Generator::place(Counts position, double fraction, double velocity) {
  base_ = position;
  state_ = {fraction, velocity, 0.0};
  planned_ = false;
  finished_ = true;
  rest_direction_ = 0.0;
}

// Adopts a new plan, made from `state` on `base`, of which `gone_s` has passed. A refused plan changes nothing: the
// previous plan continues.
Trajectory::Result Generator::begin(Trajectory::Result result, Counts base, const MotionState& state, double gone_s) {
  if (result == Trajectory::Result::bad_state || result == Trajectory::Result::bad_limits) return result;
  base_ = base;
  state_ = gone_s > 0.0 ? trajectory_.at(gone_s) : state;
  start_s_ = elapsed_s_ = gone_s;
  cycles_ = 0;
  planned_ = true;
  finished_ = trajectory_.duration_s() <= gone_s;
  rest_direction_ = 0.0;
  return result;
}

Trajectory::Result Generator::plan_position(MotionState state, double gone_s, Counts target, double end_velocity,
                                            const MotionLimits& limits, RampShape shape) {
  const Counts base = rebase(state, shape);
  return begin(trajectory_.plan_position(state, static_cast<double>(target - base), end_velocity, limits, shape), base,
               state, gone_s);
}

// The base for which the position of `state` is within one count. The acceleration of a ramp without jerk limit is
// dropped, because it may end at once; a jerk-limited plan would otherwise have to reduce it first.
Counts Generator::rebase(MotionState& state, RampShape shape) const {
  if (shape == RampShape::jerk_limited && trajectory_.shape() != RampShape::jerk_limited) state.acceleration = 0.0;
  const Counts whole = floor_to_integer(state.position);
  state.position -= static_cast<double>(whole);
  return base_ + whole;
}

Trajectory::Result Generator::move_to(Counts target, double end_velocity, const MotionLimits& limits, RampShape shape) {
  return plan_position(state_, 0.0, target, end_velocity, limits, shape);
}

Trajectory::Result Generator::run_at(double velocity, const MotionLimits& limits, RampShape shape) {
  MotionState state = state_;
  const Counts base = rebase(state, shape);
  return begin(trajectory_.plan_velocity(state, velocity, limits, shape), base, state, 0.0);
}

Trajectory::Result Generator::come_to_rest(const MotionLimits& limits, RampShape shape) {
  const double direction = state_.velocity;
  const Trajectory::Result result = run_at(0.0, limits, shape);
  if (result == Trajectory::Result::bad_state || result == Trajectory::Result::bad_limits) return result;
  rest_limits_ = limits;
  rest_shape_ = shape;
  rest_direction_ = direction;
  return result;
}

Trajectory::Result Generator::continue_to(Counts target, double end_velocity, const MotionLimits& limits,
                                          RampShape shape) {
  double remainder = planned_ && finished_ ? elapsed_s_ - trajectory_.duration_s() : 0.0;
  if (remainder < 0.0 || remainder > last_cycle_s_) remainder = 0.0;
  const MotionState from = remainder > 0.0 ? trajectory_.at(trajectory_.duration_s()) : state_;
  if (from.velocity == 0.0) remainder = 0.0;  // from rest there is no remainder of a cycle to use
  return plan_position(from, remainder, target, end_velocity, limits, shape);
}

MotionState Generator::after(double cycle_seconds) const {
  MotionState next = planned_ ? trajectory_.at(elapsed_s_ + cycle_seconds) : state_;
  if (!planned_) next.position += next.velocity * cycle_seconds;
  next.position -= static_cast<double>(round_to_integer(state_.position));
  return next;
}

void Generator::step(double cycle_seconds) {
  last_cycle_s_ = cycle_seconds;
  if (!planned_) {
    state_.position += state_.velocity * cycle_seconds;
    return;
  }
  ++cycles_;
  elapsed_s_ = start_s_ + static_cast<double>(cycles_) * cycle_seconds;
  state_ = trajectory_.at(elapsed_s_);
  finished_ = elapsed_s_ >= trajectory_.duration_s();
}

}  // namespace servodrome::drive
