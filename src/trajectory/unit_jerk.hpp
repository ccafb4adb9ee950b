#pragma once

#include "trajectory/trajectory.hpp"

/// Motion in units in which the jerk is 1: everything is divided by the jerk, so an acceleration is in s, a velocity in
/// s^2 and a position in s^3. The formulas then do not contain the jerk and do not depend on the scale of the axis.
namespace servodrome::trajectory::unit_jerk {

/// Bounds of the acceleration: `acceleration` while the speed grows, `deceleration` while it falls.
struct Limits {
  double acceleration;
  double deceleration;
};

/// Moves a state along arcs of jerk +1 and -1 and along pieces of constant acceleration, and records them if it has a
/// list. A copy without a list predicts the end of a motion.
struct Cursor {
  double position;
  double velocity;
  double acceleration;
  SegmentList* list;

  /// Constant jerk until the acceleration has the given value.
  void arc_to(double next_acceleration);
  /// Constant acceleration.
  void hold_for(double duration_s);

  /// The fastest change to a velocity and an acceleration `next_acceleration` >= 0 there, with the acceleration bounded
  /// by `cap`. Both are seen in the direction `up` (+1 or -1) in which the velocity changes. Precondition: the velocity
  /// is attainable without turning back, that is velocity + acceleration |acceleration| / 2 lies before it.
  void change_to(double next_velocity, double next_acceleration, double cap, double up);
  /// The fastest change to a velocity at acceleration 0, from any state.
  void change_to(double next_velocity, const Limits& limits);

  /// The velocity reached if the acceleration is reduced to 0 at once.
  double settling_velocity() const;
  Cursor without_list() const { return {position, velocity, acceleration, nullptr}; }
};

/// The greatest square of the acceleration at which a change of velocity from v < 0, a >= 0 may pass velocity 0 so that
/// it can end at `highest_velocity` with both limits kept. Greater than the limits allow if the start makes that
/// unavoidable.
double greatest_crossing_squared(double v, double a, double highest_velocity, const Limits& limits);

}  // namespace servodrome::trajectory::unit_jerk
