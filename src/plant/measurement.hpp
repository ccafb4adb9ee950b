#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/hardware.hpp"
#include "plant/noise.hpp"
#include "plant/parameters.hpp"

namespace servodrome::plant {

// Where the shaft truly is: counts + fraction, the fraction within 0 .. 1.
struct ShaftPlace {
  std::int64_t counts = 0;
  double fraction = 0.0;
};

// What real sensors make of the currents and of the position: offset, gain error, noise and resolution; the errors of
// an encoder's mounting and interpolation, its noise and its latency. Everything is drawn from the seed.
class Measurement {
 public:
  // `range_a`: amplitude up to which the current sensors measure, if Sensors::current_range_a does not say it.
  Measurement(const Sensors& sensors, std::int32_t counts_per_revolution, double range_a);

  bool ideal() const { return ideal_; }
  // Replaces the true currents in `feedback`, and its position unless the encoder is `frozen`, by what is measured.
  // Once a tick.
  void measure(const ShaftPlace& place, bool frozen, drive::Feedback& feedback);
  // The shaft was put somewhere else without moving.
  void place(const ShaftPlace& place) { past_.fill(place); }

 private:
  struct CurrentSensor {
    float gain = 1.0F;
    float offset_a = 0.0F;
  };
  static constexpr std::size_t past_ticks = 8;  // a power of two, more than the longest latency has

  void measure_currents(const std::array<float, 4>& noise, drive::Feedback& feedback) const;
  void measure_position(const ShaftPlace& place, double noise, drive::Feedback& feedback) const;
  double latency_counts(const ShaftPlace& place) const;
  double encoder_error_counts(double turns) const;

  bool ideal_;
  Noise noise_;
  std::array<CurrentSensor, 3> currents_{};
  float range_a_;
  float least_step_a_;  // 0: none
  float steps_per_a_;
  float current_noise_a_;
  double counts_per_revolution_;
  double turns_per_count_;
  double latency_ticks_;
  double position_noise_counts_;
  double eccentricity_counts_;
  double eccentricity_phase_;  // turns, as below
  double lines_;
  // Amplitudes at the phase of the signal period: sine and cosine, once and twice per period.
  std::array<double, 2> once_counts_{};
  std::array<double, 2> twice_counts_{};
  std::size_t tick_ = 0;
  std::array<ShaftPlace, past_ticks> past_{};  // of tick n at n modulo its size
};

}  // namespace servodrome::plant
