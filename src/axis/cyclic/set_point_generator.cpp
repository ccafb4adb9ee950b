#include "axis/cyclic/set_point_generator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace servodrome::master {

namespace {

trajectory::RampShape shape_of(const MotionLimits& limits) {
  return limits.jerk > 0.0 ? trajectory::RampShape::jerk_limited : trajectory::RampShape::linear;
}

}  // namespace

void SetPointGenerator::reset(const MotionState& state) {
  trajectory_ = {};
  trajectory_.plan_velocity({state.position, state.velocity, 0.0}, state.velocity,
                            {std::abs(state.velocity) + 1.0, 1.0, 1.0, 0.0}, trajectory::RampShape::linear);
  order_.reset();
  base_ = 0.0;
  offset_s_ = 0.0;
  cycles_ = 0;
  follows_ = next_is_set_ = false;
  state_ = state;
}

void SetPointGenerator::restart(const MotionState& state) {
  const std::optional<Order> order = order_;
  reset(state);
  if (order) carry_out(*order, From::present);
}

MotionState SetPointGenerator::start_of(From from) const {
  if (from == From::present || follows_) return state_;
  MotionState end = trajectory_.at(trajectory_.duration_s());
  end.position += base_;
  return end;
}

bool SetPointGenerator::carry_out(const Order& order, From from) {
  using Result = trajectory::Trajectory::Result;
  trajectory::Trajectory next;
  const MotionState start = start_of(from);
  const Result result = order.is_position ? next.plan_position(start, order.goal, order.end_velocity, order.limits,
                                                               shape_of(order.limits))
                                          : next.plan_velocity(start, order.goal, order.limits, shape_of(order.limits));
  if (result != Result::ok && (!order.is_position || result != Result::end_velocity_reduced)) return false;
  offset_s_ = from == From::end && !follows_ ? elapsed_s() - trajectory_.duration_s() : 0.0;
  trajectory_ = next;
  order_ = order;
  base_ = 0.0;
  cycles_ = 0;
  follows_ = next_is_set_ = false;
  if (from == From::end) state_ = trajectory_.at(offset_s_);
  return true;
}

bool SetPointGenerator::move_to(double target, double end_velocity, const MotionLimits& limits, From from) {
  return carry_out({.is_position = true, .goal = target, .end_velocity = end_velocity, .limits = limits}, from);
}

bool SetPointGenerator::run_at(double velocity, const MotionLimits& limits, From from) {
  return carry_out({.is_position = false, .goal = velocity, .limits = limits}, from);
}

void SetPointGenerator::follow(const MotionState& next) {
  follows_ = next_is_set_ = true;
  order_.reset();
  state_ = next;
}

void SetPointGenerator::shift(double distance) {
  base_ += distance;
  state_.position += distance;
}

void SetPointGenerator::advance() {
  if (std::exchange(next_is_set_, false)) return;
  if (follows_) {
    // Without a new set-point from the leader the axis continues at the same velocity.
    state_.position += state_.velocity * period_s_;
    state_.acceleration = 0.0;
    return;
  }
  ++cycles_;
  state_ = trajectory_.at(done() ? std::max(elapsed_s(), trajectory_.duration_s()) : elapsed_s());
  state_.position += base_;
}

double braking_distance(double velocity, double end_velocity, const MotionLimits& limits) {
  const double change = velocity - end_velocity;
  if (!(change > 0.0)) return 0.0;
  const double d = limits.deceleration;
  double duration = change / d;
  // With limited jerk, the deceleration either reaches d (trapezoid) or does not (triangle).
  if (limits.jerk > 0.0) {
    duration = change >= d * d / limits.jerk ? change / d + d / limits.jerk : 2.0 * std::sqrt(change / limits.jerk);
  }
  return 0.5 * (velocity + end_velocity) * duration;
}

double velocity_to_slow_within(double distance, double end_velocity, const MotionLimits& limits) {
  if (!(distance > 0.0)) return end_velocity;
  // Without a jerk limit the result is a square root; with one it lies below that and is found by bisection.
  double low = end_velocity;
  double high = std::sqrt(end_velocity * end_velocity + 2.0 * limits.deceleration * distance);
  if (!(limits.jerk > 0.0)) return high;
  constexpr int halvings = 60;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (low + high);
    (braking_distance(middle, end_velocity, limits) > distance ? high : low) = middle;
  }
  return low;
}

}  // namespace servodrome::master
