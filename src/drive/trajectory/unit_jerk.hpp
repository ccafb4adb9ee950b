#pragma once

#include "drive/trajectory/trajectory.hpp"

/// Motion in units in which the jerk is 1: everything is divided by the jerk, so that an acceleration is a time in
/// seconds, a velocity is in s^2 and a position in s^3. The formulas lose a letter each, and the scale of the axis with
/// it.
namespace servodrome::drive::unit_jerk {

/// Bounds of the acceleration: `acceleration` while the speed grows, `deceleration` while it falls.
struct Limits {
  double acceleration;
  double deceleration;
};

/// Moves a state along arcs of jerk +1 and -1 and along stretches of constant acceleration, and writes them down if it
/// has a list. A copy without a list tells where a motion would lead.
struct Cursor {
  double position;
  double velocity;
  double acceleration;
  SegmentList* list;

  /// Constant jerk until the acceleration has the given value.
  void arc_to(double next_acceleration);
  /// Constant acceleration.
  void hold_for(double duration_s);

  /// The fastest change to a velocity and an acceleration `next_acceleration` >= 0 there, both seen in the direction
  /// `up`
  /// (+1 or -1) in which the velocity changes, with the acceleration bounded by `cap`. The velocity must be attainable
  /// without turning back: velocity + acceleration |acceleration| / 2 lies before it.
  void change_to(double next_velocity, double next_acceleration, double cap, double up);
  /// The fastest change to a velocity at acceleration 0, from any state.
  void change_to(double next_velocity, const Limits& limits);

  /// The velocity reached if the acceleration is ended at once.
  double settling_velocity() const;
  Cursor without_list() const { return {position, velocity, acceleration, nullptr}; }
};

/// The greatest square of the acceleration with which a change of velocity from v < 0, a >= 0 may pass velocity 0, if
/// it is to end at `highest_velocity` or above with both limits kept. Above the limits if the start leaves no choice.
double greatest_crossing_squared(double v, double a, double highest_velocity, const Limits& limits);

}  // namespace servodrome::drive::unit_jerk
