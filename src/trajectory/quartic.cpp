#include "trajectory/quartic.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::trajectory {

double quartic_root(const Quartic& q, double low, double high, double guess) {
  double x = std::clamp(guess, low, std::max(low, high));
  for (int step = 0; step < quartic_steps; ++step) {
    const double value = (((q.c4 * x + q.c3) * x + q.c2) * x + q.c1) * x + q.c0;
    const double slope = ((4.0 * q.c4 * x + 3.0 * q.c3) * x + 2.0 * q.c2) * x + q.c1;
    const double half_curvature = (6.0 * q.c4 * x + 3.0 * q.c3) * x + q.c2;
    (value > 0.0 ? high : low) = x;
    const double discriminant = slope * slope - 4.0 * value * half_curvature;
    const double divisor = slope + std::sqrt(std::max(discriminant, 0.0));
    double next = x - 2.0 * value / divisor;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    // The iteration converges with third order: after a step this short the error is below rounding.
    if (std::abs(next - x) <= 1e-7 * std::abs(x)) return next;
    x = next;
  }
  return x;
}

}  // namespace servodrome::trajectory
