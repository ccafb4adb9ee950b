#pragma once

namespace servodrome::trajectory {

/// c4 x^4 + c3 x^3 + c2 x^2 + c1 x + c0
struct Quartic {
  double c4, c3, c2, c1, c0;
};

/// The root in [low, high] of a quartic that is convex there, <= 0 at `low` and >= 0 at `high`. Iterates from `guess`
/// with the zero of the osculating parabola (third order, also towards a double root), clamped to the bounds. A guess
/// within a factor of two needs three or four steps; the number of steps is limited to `quartic_steps`.
double quartic_root(const Quartic& q, double low, double high, double guess);

inline constexpr int quartic_steps = 16;

}  // namespace servodrome::trajectory
