#include "drive/modes/line_demand.hpp"

namespace servodrome::drive {

namespace {

// What is left of the greatest speed beside that of the line, at least.
constexpr double least_share = 0.1;

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

void LineDemand::follow(Axis& axis, const Line& line, double distance, double line_velocity) {
  Generator& generator = axis.generator;
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
  double ahead = 0.0;
  if (catching_up_) {
    // Planned anew in each cycle, in coordinates that move with the line, so that a line whose speed changes is caught
    // all the same.
    MotionLimits limits = axis.catch_up_limits();
    limits.velocity = std::max(limits.velocity - std::abs(line_velocity), least_share * limits.velocity);
    Trajectory way;
    way.plan_position({distance, velocity_ - line_velocity, 0.0}, 0.0, 0.0, limits, RampShape::linear);
    const MotionState next = way.at(axis.cycle_s);
    ahead = next.position;
    velocity_ = line_velocity + next.velocity;
    catching_up_ = way.duration_s() > axis.cycle_s;
  }
  generator.place(line.now(), line.fraction() + ahead, catching_up_ ? velocity_ : line_velocity);
  axis.follow_generator(Loop::position);
}

}  // namespace servodrome::drive
