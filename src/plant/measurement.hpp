#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/hardware.hpp"
#include "drive/transforms.hpp"
#include "plant/noise.hpp"
#include "plant/parameters.hpp"

namespace servodrome::plant {

// True position of the shaft: counts + fraction, with the fraction in 0 .. 1.
struct ShaftPlace {
  std::int64_t counts = 0;
  double fraction = 0.0;
};

// Errors of real sensors: offset, gain error, noise and resolution of the current sensors; mounting and interpolation
// errors, noise and latency of the encoder. All random values come from the seed.
class Measurement {
 public:
  // `range_a`: amplitude range of the current sensors if Sensors::current_range_a does not give it.
  Measurement(const Sensors& sensors, std::int32_t counts_per_revolution, double range_a);

  bool ideal() const { return ideal_; }
  // Replaces the true currents in `feedback` by measured ones, and the position too unless the encoder is `frozen`.
  // Call it once per tick.
  void measure(ShaftPlace place, bool frozen, drive::Feedback& feedback);
  // The shaft was placed elsewhere without moving: resets the history.
  void place(const ShaftPlace& place);

 private:
  static constexpr std::size_t past_ticks = 8;  // a power of two above the longest latency in ticks

  // A sine of the angle, in counts.
  struct Ripple {
    float amplitude = 0.0F;
    drive::Phase phase = 0;

    float at(drive::Phase angle) const;
  };

  void measure_currents(FourFloats noise, drive::Feedback& feedback) const;
  void measure_position(ShaftPlace place, float noise, drive::Feedback& feedback);
  double moved_counts(ShaftPlace place, std::size_t ticks) const;
  void expect(double single_turn);

  bool ideal_;
  Noise noise_;
  FourFloats gain_{};  // of the current sensors U, V, W
  FourFloats offset_a_{};
  float range_a_;
  float least_step_a_;  // 0: none
  float steps_per_a_;
  float current_noise_a_;
  std::int64_t counts_per_revolution_;
  double phase_per_count_;
  std::size_t whole_latency_;  // in ticks; the sum of both is the latency
  double latency_fraction_;
  float position_noise_counts_;
  std::uint32_t lines_;
  Ripple eccentricity_;
  Ripple once_;  // per signal period
  Ripple twice_;
  double expected_ = 0.0;  // place within the turn for the next measurement, and the error there
  float error_counts_ = 0.0F;
  std::size_t tick_ = 0;
  std::array<ShaftPlace, past_ticks> past_{};  // the entry of tick n is at n modulo the size
};

}  // namespace servodrome::plant
