#include "trajectory/unit_jerk.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::trajectory::unit_jerk {
namespace {

/// Merges consecutive arcs of the same jerk: the last piece is made longer.
void append(SegmentList& list, const Cursor& at, double duration_s, double jerk) {
  double begin_s = 0.0;
  if (list.count > 0) {
    TrajectorySegment& last = list.segments[list.count - 1];
    begin_s = last.begin_s + last.duration_s;
    if (last.jerk == jerk && jerk != 0.0) {
      last.duration_s += duration_s;
      return;
    }
  }
  list.segments[list.count++] = {begin_s, duration_s, at.position, at.velocity, at.acceleration, jerk};
}

}  // namespace

void Cursor::arc_to(double next_acceleration) {
  const double difference = next_acceleration - acceleration;
  const double duration = std::abs(difference);
  if (!(duration > 0.0)) return;
  const double jerk = difference > 0.0 ? 1.0 : -1.0;
  if (list != nullptr) append(*list, *this, duration, jerk);
  position += duration * (velocity + duration * (acceleration / 2.0 + difference / 6.0));
  velocity += 0.5 * duration * (acceleration + next_acceleration);
  acceleration = next_acceleration;
}

void Cursor::hold_for(double duration_s) {
  if (!(duration_s > 0.0)) return;
  if (list != nullptr) append(*list, *this, duration_s, 0.0);
  position += duration_s * (velocity + 0.5 * duration_s * acceleration);
  velocity += duration_s * acceleration;
}

double Cursor::settling_velocity() const { return velocity + 0.5 * acceleration * std::abs(acceleration); }

void Cursor::change_to(double next_velocity, double next_acceleration, double cap, double up) {
  const double a = up * acceleration;
  const double change = up * (next_velocity - velocity);
  const double a_squared = a * a;
  const double end_squared = next_acceleration * next_acceleration;
  const double highest = std::max(cap, next_acceleration);
  const double peak_squared = 0.5 * (a_squared + end_squared) + change;
  if (peak_squared <= highest * highest) {
    const double peak = std::sqrt(std::max(peak_squared, 0.0));
    arc_to(up * std::max({peak, a, next_acceleration}));
  } else {
    const double top_squared = highest * highest;
    const double first_arc = 0.5 * (a > highest ? a_squared - top_squared : top_squared - a_squared);
    arc_to(up * highest);
    hold_for((change - first_arc - 0.5 * (top_squared - end_squared)) / highest);
  }
  arc_to(up * next_acceleration);
  velocity = next_velocity;
}

double greatest_crossing_squared(double v, double a, double highest_velocity, const Limits& limits) {
  const double lower = std::min(limits.acceleration, limits.deceleration);
  const double attainable = a * a - 2.0 * v;
  const double unavoidable = a * a + 2.0 * v;
  return std::max(std::min({lower * lower, attainable, 2.0 * highest_velocity}), unavoidable);
}

void Cursor::change_to(double next_velocity, const Limits& limits) {
  const double up = next_velocity >= settling_velocity() ? 1.0 : -1.0;
  if (limits.acceleration != limits.deceleration) {
    if (up * acceleration < 0.0) arc_to(0.0);
    if (up * velocity < 0.0 && up * next_velocity > 0.0) {
      const double crossing_squared =
          greatest_crossing_squared(up * velocity, up * acceleration, up * next_velocity, limits);
      change_to(0.0, std::sqrt(std::max(crossing_squared, 0.0)), limits.deceleration, up);
    }
  }
  change_to(next_velocity, 0.0, up * velocity < 0.0 ? limits.deceleration : limits.acceleration, up);
}

}  // namespace servodrome::trajectory::unit_jerk
