#pragma once

namespace servodrome::drive {

/// c4 x^4 + c3 x^3 + c2 x^2 + c1 x + c0
struct Quartic {
  double c4, c3, c2, c1, c0;
};

/// The root in [low, high] of a quartic that is convex there, not above zero at `low` and not below it at `high`. Steps
/// to the zero of the osculating parabola (of third order, also towards a double root) from `guess`, kept between the
/// bounds; a guess within a factor of two needs three or four steps, and there are never more than `quartic_steps`.
double quartic_root(const Quartic& q, double low, double high, double guess);

inline constexpr int quartic_steps = 16;

}  // namespace servodrome::drive
