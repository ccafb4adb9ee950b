#include "drive/modes/line_demand.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace servodrome::drive {

namespace {

// Least speed for catching up, as a fraction of the greatest speed, if the line's speed leaves less.
constexpr double least_speed_share = 0.1;

}  // namespace

double LineDemand::distance_to(const Axis& axis, const Line& line) {
  return static_cast<double>(axis.generator.position() - line.now()) + (axis.generator.fraction() - line.fraction());
}

void LineDemand::begin(const Axis& axis, Line& line, Counts target, double cycles) {
  const Generator& generator = axis.generator;
  line.stand(target);
  if (held_ != 0) return;
  const double velocity = -distance_to(axis, line) / (cycles * axis.cycle_s);
  catching_up_ = jumps(axis, velocity - generator.velocity());
  velocity_ = generator.velocity();
  if (!catching_up_) line.stand(generator.position(), generator.fraction());
}

// If the line slows down from the speed `before` (clipped to the axis' greatest speed), the demand slows down by as
// much. This applies only if the demand is too fast to end at the line, at `distance`, by its own ramp, or if it has
// already passed the line, as at the end of a bridge.
void LineDemand::slow_with_line(double distance, double line_velocity, double before, double deceleration) {
  const double closes = velocity_ - line_velocity;
  if (closes * velocity_ <= 0.0 || before * velocity_ <= 0.0) return;
  const double slower = std::abs(before) - std::max(0.0, std::copysign(1.0, before) * line_velocity);
  const double way = distance * velocity_ < 0.0 ? std::abs(distance) : 0.0;
  const double excess = std::abs(closes) - std::sqrt(2.0 * deceleration * way);
  const double least = std::min({slower, excess, std::abs(velocity_)});
  if (least > 0.0) velocity_ -= std::copysign(least, velocity_);
}

void LineDemand::lead(Axis& axis, const Line& line, double line_velocity) {
  Generator& generator = axis.generator;
  const double line_before = std::exchange(line_velocity_, line_velocity);
  // The distance is measured from the place that the line, at its present speed, had one cycle ago. A line that ends in
  // this cycle has speed 0, so that its last step is part of the distance.
  const double step = -distance_to(axis, line);
  const double distance = line_velocity * axis.cycle_s - step;
  if (held_ != 0) {
    if (distance * held_ < 0.0) {
      axis.limited = true;
      generator.place(generator.position(), generator.fraction(), 0.0);
      axis.follow_generator(Loop::position);
      return;
    }
    held_ = 0;
    catching_up_ = true;
    velocity_ = 0.0;
  }
  const double greatest = axis.greatest_velocity;
  const double wanted = catching_up_ ? line_velocity : step / axis.cycle_s;  // of the demand
  if (std::abs(wanted) > greatest * (1.0 + 1e-9)) {
    axis.exceed_velocity(Mode::cyclic_sync_position);
    if (!catching_up_) velocity_ = generator.velocity();
    catching_up_ = true;
  }
  if (!catching_up_) {
    generator.place(line.now(), line.fraction(), line_velocity);
  } else {
    // Planned again in each cycle, in coordinates that move with the line, so that the demand also reaches a line whose
    // speed changes.
    MotionLimits limits = axis.catch_up_limits();
    limits.deceleration = axis.deceleration_before_limit(limits.deceleration);
    const double recedes = distance > 0.0 ? -line_velocity : line_velocity;  // speed of the line away from the axis
    limits.velocity = std::max(greatest - recedes, least_speed_share * greatest);
    slow_with_line(distance, line_velocity, std::clamp(line_before, -greatest, greatest), limits.deceleration);
    Trajectory way;
    way.plan_position({distance, velocity_ - line_velocity, 0.0}, 0.0, 0.0, limits, RampShape::linear);
    const MotionState next = way.at(axis.cycle_s);
    catching_up_ = way.duration_s() > axis.cycle_s;
    const double before = std::exchange(velocity_, line_velocity + next.velocity);
    double from = line.fraction() + next.position;
    // The demand is limited to the greatest speed, which the line may exceed, and to the speed from which it can brake
    // before a software limit. While it moves away from the line or from the line's target, it only brakes, until the
    // line is one cycle away.
    const double steepest = std::max(limits.deceleration, axis.quick_stop_ramp());
    const double approach = axis.approach_velocity(velocity_, steepest);
    const double braked = before * velocity_ > 0.0 ? std::max(0.0, std::abs(before) - steepest * axis.cycle_s) : 0.0;
    const auto leaves = [&](double from_there) {
      return velocity_ * from_there > 0.0 && std::abs(from_there) > std::abs(line_velocity) * axis.cycle_s + 1.0;
    };
    const bool flees = leaves(distance) || leaves(static_cast<double>(generator.position() - line.target()));
    const double most = approach == 0.0 || flees ? braked : std::min(greatest, approach);
    if (std::abs(velocity_) > most) {
      velocity_ = std::copysign(most, velocity_);
      from = static_cast<double>(generator.position() - line.now()) + generator.fraction() + velocity_ * axis.cycle_s;
      catching_up_ = true;
    }
    const Counts was_at = generator.position();
    generator.place(line.now(), from, velocity_);
    // If the demand crosses a software limit while it catches up with a line, it stops at the limit.
    if (!axis.within_software_limits(generator.position()) && axis.within_software_limits(was_at)) {
      generator.place(axis.nearest_within_software_limits(generator.position()), 0.0, velocity_ = 0.0);
      catching_up_ = true;
    }
  }
  axis.follow_generator(Loop::position);
}

}  // namespace servodrome::drive
