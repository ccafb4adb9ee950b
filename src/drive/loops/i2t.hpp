#pragma once

#include <cmath>

namespace servodrome::drive {

// Overload of a motor or a power stage from its current: a first-order model of the heat above what the rated current
// makes in the end. The rated current may flow for ever; the peak current, from cold, for `peak_time_s`. Any other
// current i trips from cold after -tau ln(1 - (rated / i)^2), tau = -peak_time / ln(1 - (rated / peak)^2).
//
// The heat is a double: in a float the increments of a slow model would be lost.
struct I2t {
  double rate = 0.0;                   // share of the way to its final heat that one update goes
  double rated_squared_inverse = 0.0;  // 1/A^2
  double heat = 0.0;                   // 1: what the rated current makes

  // Keeps the heat. rated_a > 0, peak_a > rated_a, times > 0; currents all as amplitude or all as rms.
  void configure(double rated_a, double peak_a, double peak_time_s, double period_s) {
    const double ratio = rated_a / peak_a;
    rate = -std::expm1(std::log1p(-ratio * ratio) * period_s / peak_time_s);
    rated_squared_inverse = 1.0 / (rated_a * rated_a);
  }

  // Once per period with the square of the current's amplitude, id^2 + iq^2.
  void update(float current_squared) {
    heat += rate * (static_cast<double>(current_squared) * rated_squared_inverse - heat);
  }

  double utilisation_percent() const { return 100.0 * heat; }
  bool tripped() const { return heat > 1.0; }
};

}  // namespace servodrome::drive
