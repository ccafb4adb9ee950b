#include "trajectory/third_order_plan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "trajectory/quartic.hpp"
#include "trajectory/unit_jerk.hpp"

namespace servodrome::trajectory::third_order_plan {
namespace {

using unit_jerk::Cursor;
using unit_jerk::Limits;

double square(double x) { return x * x; }

/// Converts the pieces back from units of jerk 1. `scale` is the jerk with the sign of the frame's positive direction.
void restore(SegmentList& list, double scale) {
  for (std::size_t i = 0; i < list.count; ++i) {
    TrajectorySegment& s = list.segments[i];
    s.position *= scale;
    s.velocity *= scale;
    s.acceleration *= scale;
    s.jerk *= scale;
  }
}

/// The last part of a plan: from the end of the climb at acceleration 0 down to the end velocity. With `none` there is
/// no descent: the climb itself ends at the target, at `end_velocity` or above.
struct Descent {
  double end_velocity;
  double deceleration;
  bool none;

  /// Distance of the descent from `peak` at acceleration 0.
  double distance(double peak) const {
    if (none) return 0.0;
    const double fall = std::max(peak - end_velocity, 0.0);
    const double steepest = std::sqrt(fall);
    const double duration = steepest <= deceleration ? 2.0 * steepest : fall / deceleration + deceleration;
    return 0.5 * (peak + end_velocity) * duration;
  }
};

/// A motion of length `way` that climbs with an acceleration of at most `cap`, cruises at up to `top_velocity` and
/// descends.
///
/// While the climb does not reach its cap, its distance and peak velocity are polynomials of the acceleration x at
/// which the jerk turns from + to -:
///   peak(x) = e + x^2,  climb(x) = x^3 + 2 e x + k,  e = v - a^2/2,  k = a^3/3 - v a + position.
/// They hold for x < 0 as well, where the axis is already braking and only brakes less for a while. Then the arc of
/// jerk -1 begins below acceleration 0, and `peak` is the velocity from which such an arc would start at acceleration
/// 0.
class Ascent {
 public:
  /// Precondition: settling_velocity() <= top_velocity, and braking at once stays within `way`.
  Ascent(Cursor& cursor, const Descent& descent, double cap, double top_velocity, double way, const Limits& limits)
      : cursor_{cursor}, descent_{descent}, cap_{cap}, top_velocity_{top_velocity}, way_{way}, limits_{limits} {
    const double v = cursor.velocity;
    const double a = cursor.acceleration;
    e_ = v - 0.5 * a * a;
    k_ = a * (a * a / 3.0 - v) + cursor.position;
  }

  void run() {
    const double highest_squared = std::min(cap_ * cap_, top_velocity_ - e_);
    const double highest = std::max(std::sqrt(std::max(highest_squared, 0.0)), cursor_.acceleration);
    const double highest_peak = e_ + highest * highest;
    const double climb = climb_to(highest);
    const double shortest = climb + descent_.distance(highest_peak);
    if (way_ <= shortest && highest_peak >= descent_.end_velocity) {
      turn_at(turning_acceleration(highest));
    } else if (highest_squared < cap_ * cap_) {
      cruise();
    } else {
      // A climb to a peak p that is held at the cap covers p^2 / 2 cap + p cap / 2 + climb_rest.
      const double climb_rest = climb - held_climb(highest_peak);
      const double longest = held_climb(top_velocity_) + climb_rest + descent_.distance(top_velocity_);
      if (way_ >= longest) {
        cruise();
      } else {
        peak_at(held_peak(std::max(highest_peak, descent_.end_velocity), climb_rest));
      }
    }
  }

 private:
  double climb_to(double x) const { return x * (x * x + 2.0 * e_) + k_; }
  double held_climb(double peak) const { return 0.5 * peak * (peak / cap_ + cap_); }

  /// The x with which the motion covers the way, in a climb that does not reach its cap; at most `highest`.
  double turning_acceleration(double highest) const {
    const double b = descent_.deceleration;
    const double vf = descent_.end_velocity;
    const double rest = way_ - k_;
    if (descent_.none) {
      const double lowest = std::max(cursor_.acceleration, std::sqrt(std::max(vf - e_, 0.0)));
      return quartic_root({0.0, 1.0, 0.0, 2.0 * e_, -rest}, lowest, highest, highest);
    }
    const double c = e_ - vf;
    const double lowest = std::max(cursor_.acceleration, c < 0.0 ? std::sqrt(-c) : -b);
    const double full_squared = b * b - c;  // x^2 from which on the descent reaches its limit
    const double full = std::sqrt(std::max(full_squared, 0.0));
    const double full_descent = descent_.distance(vf + b * b);
    const bool above = full < highest && way_ > climb_to(full) + full_descent;
    const bool below = -full > lowest && way_ < climb_to(-full) + full_descent;
    if (full_squared <= 0.0 || above || below) {
      const Quartic q{0.5 / b, 1.0, e_ / b + 0.5 * b, 2.0 * e_,
                      0.5 * e_ * (e_ / b + b) + 0.5 * vf * (b - vf / b) - rest};
      const double low = below || full_squared <= 0.0 ? lowest : std::max(lowest, full);
      const double high = below && full_squared > 0.0 ? -full : highest;
      return quartic_root(q, low, high, guess_held_descent(q));
    }
    // Neither limit is reached. With s = x + sqrt(x^2 + c), the length of the arc of jerk -1, the equation is
    //   s^4 + 4 (e + vf) s^2 - 4 (way - k) s - c^2 = 0.
    const auto arc_length = [c](double x) {
      const double root = std::sqrt(std::max(x * x + c, 0.0));
      return x < 0.0 ? c / (root - x) : x + root;
    };
    const double s = unheld_arc(c, rest, arc_length(std::max(lowest, -full)), arc_length(std::min(highest, full)));
    return s > 0.0 ? 0.5 * (s - c / s) : 0.0;
  }

  double unheld_arc(double c, double rest, double low, double high) const {
    const double sum = e_ + descent_.end_velocity;
    // The root of each term alone. The root of their sum lies within a factor of two of the greatest of these.
    double guess = std::max(std::cbrt(4.0 * std::max(rest, 0.0)), std::sqrt(std::abs(c)));
    if (sum > 0.0) {
      guess = std::min(guess, 0.5 * (rest + std::sqrt(rest * rest + sum * c * c)) / sum);
    } else {
      guess = std::max(guess, 2.0 * std::sqrt(-sum));
    }
    return quartic_root({1.0, 0.0, 4.0 * sum, -4.0 * rest, -c * c}, low, high, guess);
  }

  static double guess_held_descent(const Quartic& q) {
    // The root of the quartic without its two highest terms.
    const double discriminant = q.c1 * q.c1 - 4.0 * q.c2 * q.c0;
    const double divisor = q.c1 + std::sqrt(std::max(discriminant, 0.0));
    const double low_order = divisor > 0.0 ? -2.0 * q.c0 / divisor : std::numeric_limits<double>::infinity();
    return std::min(low_order, std::sqrt(std::sqrt(std::max(-q.c0 / q.c4, 0.0))));
  }

  /// The peak velocity with which the motion covers the way, in a climb held at its cap; from `lowest_peak` to the top
  /// velocity.
  double held_peak(double lowest_peak, double climb_rest) const {
    const double b = descent_.deceleration;
    const double vf = descent_.end_velocity;
    const double rest = way_ - climb_rest;
    if (descent_.none) return peak_of(0.5 / cap_, 0.5 * cap_, rest);
    const double full_peak = vf + b * b;
    if (lowest_peak >= full_peak ||
        (full_peak < top_velocity_ && rest >= held_climb(full_peak) + descent_.distance(full_peak))) {
      return peak_of(0.5 / cap_ + 0.5 / b, 0.5 * (cap_ + b), rest + 0.5 * vf * (vf / b - b));
    }
    // The unknown is the greatest deceleration y = sqrt(peak - vf).
    const Quartic q{0.5 / cap_, 1.0, vf / cap_ + 0.5 * cap_, 2.0 * vf, held_climb(vf) - rest};
    const double left = std::max(-q.c0, 0.0);
    double guess = std::min(std::sqrt(std::sqrt(left / q.c4)), std::sqrt(left / q.c2));
    if (q.c1 * guess > left) guess = left / q.c1;
    const double low = std::sqrt(std::max(lowest_peak - vf, 0.0));
    const double high = std::sqrt(std::max(std::min(top_velocity_, full_peak) - vf, 0.0));
    return vf + square(quartic_root(q, low, high, guess));
  }

  /// The upper root of m p^2 + q p = rest.
  static double peak_of(double m, double q, double rest) {
    return 2.0 * rest / (q + std::sqrt(std::max(q * q + 4.0 * m * rest, 0.0)));
  }

  void turn_at(double x) {
    cursor_.arc_to(std::max(x, cursor_.acceleration));
    descend();
  }

  void peak_at(double peak) {
    cursor_.change_to(peak, 0.0, cap_, 1.0);
    descend();
  }

  void cruise() {
    cursor_.change_to(top_velocity_, 0.0, cap_, 1.0);
    if (descent_.none) return;
    cursor_.hold_for((way_ - cursor_.position - descent_.distance(top_velocity_)) / top_velocity_);
    descend();
  }

  void descend() {
    if (descent_.none) {
      cursor_.arc_to(0.0);
    } else {
      cursor_.change_to(descent_.end_velocity, limits_);
    }
  }

  Cursor& cursor_;
  const Descent& descent_;
  double cap_;
  double top_velocity_;
  double way_;
  const Limits& limits_;
  double e_;
  double k_;
};

/// Brakes from above the top velocity until a single arc leads down to it. The remaining decision, to complete that arc
/// and cruise or to continue braking, is then the same as from a state within the limits.
void brake_towards(Cursor& cursor, double top_velocity, double deceleration) {
  const double a = cursor.acceleration;
  const double change = cursor.velocity - top_velocity;
  const double peak_squared = 0.5 * a * a + change;
  if (peak_squared <= deceleration * deceleration) {
    cursor.arc_to(std::min(a, -std::sqrt(std::max(peak_squared, 0.0))));
    return;
  }
  cursor.arc_to(-deceleration);
  cursor.hold_for((cursor.velocity - top_velocity - 0.5 * deceleration * deceleration) / deceleration);
}

/// Distance of the fastest change to a velocity.
double distance_of_change(const Cursor& from, double velocity, const Limits& limits) {
  Cursor cursor = from.without_list();
  cursor.change_to(velocity, limits);
  return cursor.position;
}

/// Climbs, cruises and descends, with the limit that applies to each sign of the velocity.
void climb_and_descend(Cursor& cursor, const Descent& descent, double top_velocity, double way, const Limits& limits) {
  double cap = limits.acceleration;
  double top = top_velocity;
  // If the axis would otherwise reverse, it first has to reduce its acceleration to 0.
  const bool separate = limits.acceleration != limits.deceleration;
  if (separate && cursor.acceleration < 0.0 && cursor.settling_velocity() < 0.0) cursor.arc_to(0.0);
  if (separate && cursor.velocity < 0.0) {
    // Up to velocity 0 the other limit applies. The axis either passes velocity 0 with the greatest permitted
    // acceleration, or begins to brake before.
    const double crossing_squared =
        std::max(unit_jerk::greatest_crossing_squared(cursor.velocity, cursor.acceleration, top_velocity, limits), 0.0);
    const double crossing = std::sqrt(crossing_squared);
    const double lowest_peak = 0.5 * crossing_squared;
    Cursor shortest = cursor.without_list();
    shortest.change_to(0.0, crossing, limits.deceleration, 1.0);
    shortest.change_to(lowest_peak, 0.0, limits.acceleration, 1.0);
    if (lowest_peak <= descent.end_velocity || way >= shortest.position + descent.distance(lowest_peak)) {
      cursor.change_to(0.0, crossing, limits.deceleration, 1.0);
    } else {
      cap = limits.deceleration;
      top = lowest_peak;
    }
  }
  if (cursor.acceleration > cap) cursor.arc_to(cap);
  Ascent{cursor, descent, cap, top, way, limits}.run();
}

}  // namespace

ramp_plan::Outcome to_position(SegmentList& list, const MotionState& start, double distance, double resolution,
                               double end_velocity, const MotionLimits& limits) {
  const double unit = 1.0 / limits.jerk;
  const Limits bounds{limits.acceleration * unit, limits.deceleration * unit};
  const double end = end_velocity * unit;
  const double top_velocity = limits.velocity * unit;
  double sign = 1.0;
  double way = distance * unit;
  Cursor cursor{0.0, start.velocity * unit, start.acceleration * unit, &list};
  const auto mirror = [&] {
    sign = -sign;
    way = -way;
    cursor.velocity = -cursor.velocity;
    cursor.acceleration = -cursor.acceleration;
  };

  // The axis keeps its direction of travel if it can pass the target that way, at any velocity up to the requested
  // one. Otherwise it overshoots and approaches from the other side. The comparison allows for rounding of the
  // distance.
  double settling = cursor.settling_velocity();
  if ((settling != 0.0 ? settling : way) < 0.0) {
    mirror();
    settling = -settling;
  }
  double directly = distance_of_change(cursor, 0.0, bounds);
  const double slowest = std::min(settling, end);
  const double nearest = slowest > 0.0 ? std::min(directly, distance_of_change(cursor, slowest, bounds)) : directly;
  const double tolerance = std::max(1e-12 * std::max(std::abs(nearest), std::abs(way)), resolution * unit);
  if (way < nearest - tolerance) {
    mirror();
    settling = -settling;
    directly = -directly;
  }
  if (end > 0.0) directly = distance_of_change(cursor, end, bounds);

  bool reduced = false;
  if (std::abs(way - directly) <= tolerance) {
    cursor.change_to(end, bounds);
  } else if (way > directly) {
    if (cursor.acceleration < -bounds.deceleration) cursor.arc_to(-bounds.deceleration);
    if (settling > top_velocity) brake_towards(cursor, top_velocity, bounds.deceleration);
    climb_and_descend(cursor, {end, bounds.deceleration, false}, top_velocity, way, bounds);
  } else {
    // Either the target is too near to accelerate to the end velocity, or the axis brakes so hard that it must pass
    // the target more slowly. Seen in the opposite direction, the latter is a climb towards velocity 0.
    reduced = true;
    const double least = std::max(settling, 0.0);
    if (least < end && way >= distance_of_change(cursor, least, bounds) - tolerance) {
      climb_and_descend(cursor, {least, bounds.deceleration, true}, end, way, bounds);
    } else {
      mirror();
      climb_and_descend(cursor, {-std::min(least, end), bounds.deceleration, true}, 0.0, way, bounds);
    }
  }
  const double scale = sign * limits.jerk;
  restore(list, scale);
  return {cursor.velocity * scale, reduced};
}

void to_velocity(SegmentList& list, const MotionState& start, double target_velocity, const MotionLimits& limits) {
  const double unit = 1.0 / limits.jerk;
  Cursor cursor{0.0, start.velocity * unit, start.acceleration * unit, &list};
  cursor.change_to(target_velocity * unit, {limits.acceleration * unit, limits.deceleration * unit});
  restore(list, limits.jerk);
}

}  // namespace servodrome::trajectory::third_order_plan
