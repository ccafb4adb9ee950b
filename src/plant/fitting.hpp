#pragma once

#include <cmath>

// One-step integration of a decaying state: inertia * (x1 - x0) / h = drive - rate * inertia * xm, with the weighted
// mean xm = (1 - weight) * x0 + weight * x1.
namespace servodrome::plant {

// The weight of the new value that makes the step agree with the exponential solution for constant drive; `z` is
// rate * h >= 0. 1/2 (the trapezoidal rule) for z -> 0, 1 (backward Euler) for z -> infinity: stable, without ringing
// and passive for every z, and h * xm is the exact integral of x.
inline double fitted_weight(double z) {
  if (z < 1.0e-2) return 0.5 + z / 12.0 * (1.0 - z * z / 60.0);  // series: the closed form cancels
  return -1.0 / std::expm1(-z) - 1.0 / z;
}

}  // namespace servodrome::plant
