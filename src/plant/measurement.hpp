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
  void place(const ShaftPlace& place) { before_.fill(place); }

 private:
  struct CurrentSensor {
    double offset_a = 0.0;
    double gain = 1.0;
  };
  static constexpr std::size_t longest_latency_ticks = 4;

  void measure_currents(drive::Feedback& feedback);
  void measure_position(const ShaftPlace& place, drive::Feedback& feedback);
  double latency_counts(const ShaftPlace& place);
  double encoder_error_counts(double turns);

  bool ideal_;
  Noise noise_;
  std::array<CurrentSensor, 3> currents_{};
  double range_a_;
  double least_step_a_;  // 0: none
  double current_noise_a_;
  double counts_per_revolution_;
  double latency_ticks_;
  double position_noise_counts_;
  double eccentricity_counts_;
  double eccentricity_phase_;  // turns, as below
  double lines_;
  std::array<double, 2> interpolation_counts_;
  std::array<double, 2> interpolation_phase_{};
  std::array<ShaftPlace, longest_latency_ticks + 1> before_{};  // at the ends of the ticks before, the newest first
};

}  // namespace servodrome::plant
