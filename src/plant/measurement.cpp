#include "plant/measurement.hpp"

#include <algorithm>
#include <cmath>

#include "drive/rounding.hpp"
#include "drive/transforms.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {

constexpr double arcsec_per_turn = 360.0 * 3600.0;

// A turn of the sine in steps. Linear interpolation between them has an error below 5e-6.
constexpr unsigned step_bits = 22;
constexpr std::size_t steps = std::size_t{1} << (32 - step_bits);
constexpr auto sine_steps = [] {
  std::array<float, steps + 1> sines{};
  for (std::size_t i = 0; i < sines.size(); ++i) {
    sines[i] = drive::sin_cos(static_cast<drive::Phase>(i << step_bits)).sine;
  }
  return sines;
}();

}  // namespace

Measurement::Measurement(const Sensors& sensors, std::int32_t counts_per_revolution, double range_a)
    : ideal_(sensors.ideal),
      noise_(sensors.seed),
      counts_per_revolution_(counts_per_revolution),
      phase_per_count_(0x1p32 / counts_per_revolution),
      whole_latency_(static_cast<std::size_t>(sensors.encoder_latency_us / tick_us)),
      latency_fraction_(sensors.encoder_latency_us / tick_us - static_cast<double>(whole_latency_)),
      lines_(static_cast<std::uint32_t>(sensors.encoder_lines)) {
  const double counts_per_arcsec = counts_per_revolution / arcsec_per_turn;
  const auto ripple = [&](double arcsec) {
    return Ripple{.amplitude = static_cast<float>(arcsec * counts_per_arcsec), .phase = drive::phase_of(noise_.even())};
  };
  eccentricity_ = ripple(sensors.eccentricity_arcsec);
  const double range = sensors.current_range_a > 0.0 ? sensors.current_range_a : range_a;
  const double step = sensors.current_bits > 0 ? std::ldexp(2.0 * range, -sensors.current_bits) : 0.0;
  range_a_ = static_cast<float>(range);
  least_step_a_ = static_cast<float>(step);
  steps_per_a_ = step > 0.0 ? static_cast<float>(1.0 / step) : 0.0F;
  current_noise_a_ = static_cast<float>(sensors.current_noise * range);
  for (std::size_t phase = 0; phase < 3; ++phase) {
    offset_a_[phase] = static_cast<float>(noise_.even() * sensors.current_offset * range);
    gain_[phase] = static_cast<float>(1.0 + noise_.even() * sensors.current_gain_error);
  }
  position_noise_counts_ = static_cast<float>(sensors.encoder_noise_arcsec * counts_per_arcsec);
  if (lines_ > 0) {
    once_ = ripple(sensors.interpolation_arcsec);
    twice_ = ripple(sensors.interpolation_second_arcsec);
  }
}

void Measurement::measure(ShaftPlace place, bool frozen, drive::Feedback& feedback) {
  const FourFloats noise = noise_.four();
  past_[++tick_ % past_ticks] = place;
  measure_currents(noise, feedback);
  if (!frozen) measure_position(place, noise[3], feedback);
}

// One vector for all phases: a loop over them takes 40 instructions of a tick more.
[[gnu::always_inline]] inline void Measurement::measure_currents(FourFloats noise, drive::Feedback& feedback) const {
  constexpr float no_fraction = 0x1.8p23F;  // adding and subtracting it rounds to an integer
  const FourFloats high_a{range_a_, range_a_, range_a_, range_a_};
  const FourFloats low_a = -high_a;
  auto& [u, v, w] = feedback.phase_current_a;
  FourFloats current_a = FourFloats{u, v, w} * gain_ + offset_a_ + current_noise_a_ * noise;
  current_a = current_a < low_a ? low_a : current_a;
  current_a = current_a > high_a ? high_a : current_a;
  if (least_step_a_ > 0.0F) current_a = ((current_a * steps_per_a_ + no_fraction) - no_fraction) * least_step_a_;
  u = current_a[0];
  v = current_a[1];
  w = current_a[2];
}

// Distance that the shaft has moved in the last ticks.
[[gnu::always_inline]] inline double Measurement::moved_counts(ShaftPlace place, std::size_t ticks) const {
  const ShaftPlace& then = past_[(tick_ - ticks) % past_ticks];
  return static_cast<double>(place.counts - then.counts) + (place.fraction - then.fraction);
}

[[gnu::always_inline]] inline float Measurement::Ripple::at(drive::Phase angle) const {
  const drive::Phase sum = angle + phase;
  const std::size_t step = sum >> step_bits;
  const float share =
      static_cast<float>(static_cast<std::int32_t>(sum & ((1U << step_bits) - 1U))) * (1.0F / (1U << step_bits));
  return amplitude * (sine_steps[step] + share * (sine_steps[step + 1] - sine_steps[step]));
}

[[gnu::always_inline]] inline void Measurement::measure_position(ShaftPlace place, float noise,
                                                                 drive::Feedback& feedback) {
  const double step = moved_counts(place, 1);
  double late = latency_fraction_ * step;  // distance that the shaft has moved since the encoder sampled it
  if (whole_latency_ != 0) {
    const double newer = moved_counts(place, whole_latency_);
    late = newer + latency_fraction_ * (moved_counts(place, whole_latency_ + 1) - newer);
  }
  const double off = place.fraction - late;
  const auto true_single = static_cast<std::int64_t>(feedback.single_turn_counts);
  const std::int64_t counts =
      drive::floor_to_integer(off + static_cast<double>(error_counts_ + position_noise_counts_ * noise));
  feedback.position_counts += counts;
  std::int64_t single = true_single + counts;
  if (single < 0 || single >= counts_per_revolution_) [[unlikely]]
    single = (single % counts_per_revolution_ + counts_per_revolution_) % counts_per_revolution_;
  feedback.single_turn_counts = static_cast<std::uint32_t>(single);
  const double expected = static_cast<double>(true_single) + off + step;
  if (expected != expected_) expect(expected);
}

// The error of the encoder in the next tick is computed for the place that the present speed predicts. So the processor
// can compute it while it solves the machine; the true place is known only after that.
[[gnu::always_inline]] inline void Measurement::expect(double single_turn) {
  expected_ = single_turn;
  const auto angle = static_cast<drive::Phase>(static_cast<std::int64_t>(single_turn * phase_per_count_));
  const drive::Phase signal = angle * lines_;
  error_counts_ = eccentricity_.at(angle) + (once_.at(signal) + twice_.at(2 * signal));
}

void Measurement::place(const ShaftPlace& place) {
  past_.fill(place);
  expect(static_cast<double>(place.counts % counts_per_revolution_) + place.fraction);
}

}  // namespace servodrome::plant
