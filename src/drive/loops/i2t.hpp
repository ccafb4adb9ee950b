#pragma once

#include <cmath>

namespace servodrome::drive {

// Overload of a motor or a power stage from its current: a first-order thermal model, relative to the final heat of the
// rated current. The rated current may flow without limit of time; the peak current, from cold, for `peak_time_s`. Any
// other current i trips from cold after -tau ln(1 - (rated / i)^2), tau = -peak_time / ln(1 - (rated / peak)^2).
//
// The heat is a double: in a float the increments of a slow model would be lost.
struct I2t {
  double rate = 0.0;                   // fraction of the difference to the final heat per update
  double rated_squared_inverse = 0.0;  // 1/A^2
  double heat = 0.0;                   // 1: final heat of the rated current

  // Keeps the heat. rated_a > 0, peak_a > rated_a, times > 0; currents all as amplitude or all as rms.
  void configure(double rated_a, double peak_a, double peak_time_s, double period_s) {
    const double ratio = rated_a / peak_a;
    rate = -std::expm1(std::log1p(-ratio * ratio) * period_s / peak_time_s);
    rated_squared_inverse = 1.0 / (rated_a * rated_a);
  }

  // Call this once per period with the square of the current's amplitude, id^2 + iq^2.
  void update(float current_squared) {
    heat += rate * (static_cast<double>(current_squared) * rated_squared_inverse - heat);
  }

  double utilisation_percent() const { return 100.0 * heat; }
  bool tripped() const { return heat > 1.0; }
};

}  // namespace servodrome::drive
