#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "drive/lag_filter.hpp"
#include "drive/loops/cascade.hpp"
#include "drive/moving_average.hpp"
#include "drive/rounding.hpp"

namespace servodrome::drive {

// Smooths the demand of a mode: by a moving average or by a low pass. The loops then get a demand that lags behind the
// demand of the generator.
//
// A filter delays the demand and must never move the axis. Therefore a filter starts only while the demand is constant,
// and a filter setting that is written during a motion takes effect after the motion.
class DemandSmoothing {
 public:
  static constexpr std::int64_t unit = 65536;  // parts of a count, or of a count per second

  struct Filter {
    std::size_t cycles = 0;  // of the moving average; 0: none
    float lag_ms = 0.0F;     // of the low pass; 0: none
    bool any() const { return cycles > 0 || lag_ms > 0.0F; }
    friend bool operator==(const Filter&, const Filter&) = default;
  };

  bool lags() const { return lags_; }  // the smoothed demand has not reached the demand
  bool lags(Loop loop) const { return lags_ && loop_ == loop; }
  bool is_position() const { return loop_ == Loop::position; }
  std::int64_t position_counts() const { return value_ >> 16; }
  float velocity() const { return velocity_; }  // counts/s

  // Call this when the demand jumps, for example to the smoothed demand: the filter then starts anew.
  void leave() { loop_ = Loop::off; }
  void stop() {
    loop_ = Loop::off;
    lags_ = false;
  }

  // One cycle. `from`: the demand in `unit`, if it was constant before this cycle. `held`: the shaft may have slipped,
  // so the demand is its present position.
  void apply(LoopDemand& demand, const Filter& asked, std::optional<std::int64_t> from, bool held, double cycle_s,
             double cycles_per_ms) {
    const bool runs = lags(demand.loop);
    if (!runs && !asked.any()) return stop();
    const bool position = demand.loop == Loop::position;
    constexpr double parts = unit;
    const std::int64_t value =
        position ? demand.position * unit + round_to_integer(static_cast<double>(demand.position_fraction) * parts)
                 : round_to_integer(static_cast<double>(demand.velocity) * parts);
    held = held && position;
    if (!runs && (held || loop_ != demand.loop || !(asked == by_))) {
      if (held) from = value;
      if (!from) return leave();
      begin(demand.loop, asked, position ? *from : 0);
    }
    const float before = velocity_;
    std::int64_t mean = 0;
    if (by_.cycles > 0) {
      mean = average_.update(value);
      const std::int64_t velocity = position ? mean - value_ : mean;
      velocity_ = static_cast<float>(static_cast<double>(velocity) / parts / (position ? cycle_s : 1.0));
    } else {
      lag_.configure(static_cast<double>(by_.lag_ms) * cycles_per_ms);
      mean = lag_.update(value);
      // The velocity gets the same lag, so that an offset that a mode adds to it is kept.
      velocity_ += static_cast<float>(lag_.gain()) * (demand.velocity - velocity_);
      if (mean == value) velocity_ = demand.velocity;
    }
    lags_ = mean != value;
    if (position) {
      demand.position = mean >> 16;
      demand.position_fraction = static_cast<float>(static_cast<double>(mean & 0xFFFF) / parts);
    }
    value_ = mean;
    demand.velocity = velocity_;
    demand.acceleration = (velocity_ - before) / static_cast<float>(cycle_s);
  }

 private:
  void begin(Loop loop, const Filter& filter, std::int64_t value) {
    by_ = filter;
    if (filter.cycles > 0) average_.begin(value, filter.cycles);
    lag_.begin(value);
    value_ = value;
    velocity_ = 0.0F;
    loop_ = loop;
  }

  Loop loop_ = Loop::off;  // of the smoothed demand
  bool lags_ = false;
  Filter by_{};
  std::int64_t value_ = 0;  // the mean, in `unit`
  float velocity_ = 0.0F;
  LagFilter lag_{};
  MovingAverage average_{};
};

}  // namespace servodrome::drive
