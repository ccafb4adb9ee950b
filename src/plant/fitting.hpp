#pragma once

#include <cmath>

// One-step integration of a decaying state: inertia * (x1 - x0) / h = drive - rate * inertia * xm, with the weighted
// mean xm = (1 - weight) * x0 + weight * x1.
namespace servodrome::plant {

// Weight of the new value for which the step equals the exponential solution for a constant drive; `z` = rate * h must
// not be negative. The weight is 1/2 (trapezoidal rule) for z -> 0 and 1 (backward Euler) for z -> infinity. The step
// is stable, does not ring, is passive for every z, and h * xm is the exact integral of x.
inline double fitted_weight(double z) {
  if (z < 1.0e-2) return 0.5 + z / 12.0 * (1.0 - z * z / 60.0);  // series, because the closed form loses precision
  return -1.0 / std::expm1(-z) - 1.0 / z;
}

}  // namespace servodrome::plant
