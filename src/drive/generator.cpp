#include "drive/generator.hpp"

#include <cmath>

namespace servodrome::drive {

void Generator::start_from(Counts position, double velocity) { place(position, 0.0, velocity); }

void Generator::place(Counts position, double fraction, double velocity) {
  base_ = position;
  state_ = {fraction, velocity, 0.0};
  planned_ = false;
  finished_ = true;
}

void Generator::rebase() {
  const double whole = std::floor(state_.position);
  base_ += static_cast<Counts>(whole);
  state_.position -= whole;
}

void Generator::begin(Trajectory::Result result) {
  if (result == Trajectory::Result::bad_state || result == Trajectory::Result::bad_limits) return;
  cycles_ = 0;
  elapsed_s_ = 0.0;
  planned_ = true;
  finished_ = trajectory_.duration_s() <= 0.0;
}

Trajectory::Result Generator::move_to(Counts target, double end_velocity, const MotionLimits& limits, RampShape shape) {
  rebase();
  start_s_ = 0.0;
  const Trajectory::Result result =
      trajectory_.plan_position(state_, static_cast<double>(target - base_), end_velocity, limits, shape);
  begin(result);
  return result;
}

Trajectory::Result Generator::run_at(double velocity, const MotionLimits& limits, RampShape shape) {
  rebase();
  start_s_ = 0.0;
  const Trajectory::Result result = trajectory_.plan_velocity(state_, velocity, limits, shape);
  begin(result);
  return result;
}

Trajectory::Result Generator::continue_to(Counts target, double end_velocity, const MotionLimits& limits,
                                          RampShape shape) {
  double remainder = planned_ && finished_ ? elapsed_s_ - trajectory_.duration_s() : 0.0;
  if (remainder < 0.0 || remainder > last_cycle_s_) remainder = 0.0;
  if (remainder > 0.0) state_ = trajectory_.at(trajectory_.duration_s());
  const Trajectory::Result result = move_to(target, end_velocity, limits, shape);
  start_s_ = remainder;
  if (remainder > 0.0 && planned_) {
    elapsed_s_ = remainder;
    state_ = trajectory_.at(remainder);
    finished_ = elapsed_s_ >= trajectory_.duration_s();
  }
  return result;
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

Counts Generator::position() const { return base_ + static_cast<Counts>(std::floor(state_.position)); }
double Generator::fraction() const { return state_.position - std::floor(state_.position); }
Counts Generator::nearest_position() const { return base_ + std::llround(state_.position); }

}  // namespace servodrome::drive
