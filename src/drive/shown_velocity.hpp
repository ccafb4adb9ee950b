#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "drive/loops/motor_data.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// The velocity for 606Ch and the statusword's windows. The estimate of the loops is fast, but one count changes it by
// a whole count per period. This one is smooth, with a known delay: the mean of the last N positions less the mean of
// the N before, divided by N cycles. One count changes it by at most 1 / N of a count per cycle; standstill is exactly
// 0, and a constant velocity is exact on average.
class ShownVelocity {
 public:
  static constexpr std::size_t longest = 32;

  // The lag in ms with which one count changes the velocity by at most 0.1 % of the rated speed, clipped to 4 .. 16 ms.
  static float needed_ms(const MotorData& motor) {
    const float rated_counts_per_ms = motor.rated_speed_rpm / 60.0e3F * static_cast<float>(motor.counts_per_revolution);
    return std::clamp(std::ceil(1.0e3F / std::max(rated_counts_per_ms, 1.0F)), 4.0F, 16.0F);
  }

  // `lag_ms` becomes a whole number of cycles, 1 to `longest`. `filter_ms`: time constant of a low pass after it; 0:
  // none. Measured values are kept unless the lag changes.
  void configure(float lag_ms, float filter_ms, double cycle_s) {
    const double cycles = std::round(1.0e-3 * static_cast<double>(lag_ms) / cycle_s);
    const auto window = static_cast<std::size_t>(std::clamp(cycles, 1.0, static_cast<double>(longest)));
    if (window != window_) forget();
    window_ = window;
    const double filter_cycles = 1.0e-3 * static_cast<double>(filter_ms) / cycle_s;
    if (filter_cycles_ <= 0.0) filtered_ = measured();
    filter_cycles_ = filter_cycles;
    filter_gain_ = filter_cycles > 0.0 ? -std::expm1(-1.0 / filter_cycles) : 1.0;
  }
  void forget() { measuring_ = false; }

  // Once per position-loop cycle.
  void update(Counts position) {
    if (!measuring_) [[unlikely]]
      begin(position);
    // Uses the last crossed edge of a count, as the loops do, so that an axis standing on an edge shows 0.
    edge_ = std::clamp(edge_, position, position + 1);
    const std::size_t middle = next_ < window_ ? next_ + window_ : next_ - window_;
    difference_ += edge_ - 2 * edges_[middle] + edges_[next_];
    edges_[next_] = edge_;
    next_ = next_ + 1 == 2 * window_ ? 0 : next_ + 1;
    if (filter_cycles_ > 0.0) filter();
  }

  double counts_per_cycle() const { return filter_cycles_ > 0.0 ? filtered_ : measured(); }
  double lag_cycles() const { return static_cast<double>(window_) - 0.5 + filter_cycles_; }

 private:
  double measured() const { return static_cast<double>(difference_) / static_cast<double>(window_ * window_); }
  void begin(Counts position) {
    edge_ = position;
    edges_.fill(position);
    next_ = 0;
    difference_ = 0;
    filtered_ = 0.0;
    measuring_ = true;
  }
  void filter() {
    filtered_ += filter_gain_ * (measured() - filtered_);
    // smallest velocity other than 0 that can be measured
    const double smallest = 1.0 / static_cast<double>(window_ * window_);
    if (difference_ == 0 && std::abs(filtered_) < 0.5 * smallest) filtered_ = 0.0;
  }

  std::size_t window_ = 8;
  std::size_t next_ = 0;
  Counts edge_ = 0;
  Counts difference_ = 0;  // sum of the last `window_` edges less that of those before
  double filter_cycles_ = 0.0;
  double filter_gain_ = 1.0;
  double filtered_ = 0.0;  // counts per cycle
  bool measuring_ = false;
  std::array<Counts, 2 * longest> edges_{};  // a ring of the last 2 `window_`; `next_` is the oldest
};

}  // namespace servodrome::drive
