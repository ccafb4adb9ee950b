#include "fit/windows.hpp"

#include <algorithm>
#include <limits>

namespace servodrome::fit {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// The bump is (1 - s^2)^4 for s in -1 .. 1. The sums use the second integral of the weight of a moment. For the signal
// itself this is the second integral of the bump, for its first derivative the first integral, for its second
// derivative the bump, for its third derivative the slope of the bump.
constexpr double bump_integral = 256.0 / 315.0;

double twice_integrated(double s, unsigned derivative) {
  const double q = s * s;
  if (derivative == 3) return s <= -1.0 || s >= 1.0 ? 0.0 : -8.0 * s * (1.0 - q) * (1.0 - q) * (1.0 - q);
  if (derivative == 2) return s <= -1.0 || s >= 1.0 ? 0.0 : (1.0 - q) * (1.0 - q) * (1.0 - q) * (1.0 - q);
  if (derivative == 1) {
    if (s <= -1.0) return 0.0;
    if (s >= 1.0) return bump_integral;
    return 0.5 * bump_integral + s * (1.0 + q * (-4.0 / 3.0 + q * (6.0 / 5.0 + q * (-4.0 / 7.0 + q / 9.0))));
  }
  if (s <= -1.0) return 0.0;
  if (s >= 1.0) return bump_integral * s;
  constexpr double at_end = 1.0 / 2.0 - 1.0 / 3.0 + 1.0 / 5.0 - 1.0 / 14.0 + 1.0 / 90.0;
  return 0.5 * bump_integral * (1.0 + s) - at_end +
         q * (0.5 + q * (-1.0 / 3.0 + q * (1.0 / 5.0 + q * (-1.0 / 14.0 + q / 90.0))));
}

}  // namespace

double period_of(const std::vector<double>& seconds) {
  if (seconds.size() < 2) return 0.0;
  double gaps = 0.0;
  std::size_t steps = seconds.size() - 1;
  for (std::size_t i = 1; i < seconds.size(); ++i) {
    const double step = seconds[i] - seconds[i - 1];
    if (step <= gap_s) continue;
    gaps += step;
    --steps;
  }
  const double whole = seconds.back() - seconds.front();
  return steps > 0 ? (whole - gaps) / static_cast<double>(steps) : whole / static_cast<double>(seconds.size() - 1);
}

Windows::Windows(const std::vector<double>& seconds, double length_s) : seconds_(seconds), length_(length_s) {
  const double period = period_of(seconds);
  longest_gap_ = std::max(4.0 * period, 0.1 * length_s);
  if (seconds.size() < 2 || 4.0 * period > length_s) return;
  std::size_t next = 0;  // the first sample after the start
  for (double start = seconds.front(); start + length_s <= seconds.back(); start += length_s / overlap) {
    while (seconds[next] <= start) ++next;
    if (start + length_s < seconds[next]) start = seconds[next];  // skips windows inside a gap
    if (start + length_s <= seconds.back()) starts_.push_back(start);
  }
}

std::vector<double> Windows::moments(const std::vector<double>& x, unsigned derivative, double delay_s,
                                     Half half) const {
  // The signal is interpolated linearly between its samples. The integral over one segment is a difference of
  // twice_integrated(). Each sample's weight is the sum of the parts from the two segments that meet there. So steps
  // may be unequal, and the derivative of a constant is exactly 0.
  const std::size_t step = half == Half::all ? 1 : 2;
  const std::size_t origin = half == Half::odd ? 1 : 0;
  const double slope = 2.0 / length_;  // ds/dt
  double scale = 1.0 / bump_integral;
  for (unsigned i = 0; i < derivative; ++i) scale *= -slope;
  std::vector<double> result(starts_.size(), nan);
  std::size_t first = origin;
  for (std::size_t window = 0; window < starts_.size(); ++window) {
    const double begin = starts_[window] - delay_s;
    const double end = begin + length_;
    while (first + step < seconds_.size() && seconds_[first + step] <= begin) first += step;
    if (seconds_[first] > begin || first + step >= seconds_.size()) continue;
    const auto s_of = [&](std::size_t i) { return (seconds_[i] - begin) * slope - 1.0; };
    double sum = 0.0;
    bool whole = true;
    double s = s_of(first);
    double function = twice_integrated(s, derivative);
    double rise = 0.0;  // slope of the function on the segment before the sample
    std::size_t i = first;
    for (; seconds_[i] < end; i += step) {
      if (i + step >= seconds_.size()) {
        whole = false;
        break;
      }
      const double next_s = s_of(i + step);
      const double next_function = twice_integrated(next_s, derivative);
      const double next_rise = (next_function - function) / (next_s - s);
      sum += (next_rise - rise) * x[i];
      if (seconds_[i + step] - seconds_[i] > longest_gap_) whole = false;
      s = next_s;
      function = next_function;
      rise = next_rise;
    }
    // Beyond the window the function is a straight line.
    const double last_rise = derivative == 0 ? bump_integral : 0.0;
    if (whole) result[window] = scale * (sum + (last_rise - rise) * x[i]);
  }
  return result;
}

void Windows::range(const std::vector<double>& x, std::vector<double>& least, std::vector<double>& greatest) const {
  least.assign(starts_.size(), nan);
  greatest.assign(starts_.size(), nan);
  std::size_t first = 0;
  for (std::size_t window = 0; window < starts_.size(); ++window) {
    while (first < seconds_.size() && seconds_[first] < starts_[window]) ++first;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (std::size_t i = first; i < seconds_.size() && seconds_[i] <= starts_[window] + length_; ++i) {
      if (!(x[i] == x[i])) low = high = nan;
      low = std::min(low, x[i]);
      high = std::max(high, x[i]);
    }
    least[window] = low;
    greatest[window] = high;
  }
}

}  // namespace servodrome::fit
