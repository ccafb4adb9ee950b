#include "plant/measurement.hpp"

#include <algorithm>
#include <cmath>

#include "drive/rounding.hpp"
#include "drive/transforms.hpp"

namespace servodrome::plant {

namespace {

constexpr double arcsec_per_turn = 360.0 * 3600.0;
constexpr double tick_us = drive::tick_seconds * 1.0e6;

drive::SinCos at(double turns) { return drive::sin_cos(drive::phase_of(turns)); }

// Coefficients of sin x and cos x in amplitude * sin(x + phase).
std::array<double, 2> shares(double amplitude, double phase_turns) {
  const drive::SinCos phase = at(phase_turns);
  return {amplitude * static_cast<double>(phase.cosine), amplitude * static_cast<double>(phase.sine)};
}

}  // namespace

Measurement::Measurement(const Sensors& sensors, std::int32_t counts_per_revolution, double range_a)
    : ideal_(sensors.ideal),
      noise_(sensors.seed),
      counts_per_revolution_(counts_per_revolution),
      turns_per_count_(1.0 / counts_per_revolution),
      latency_ticks_(sensors.encoder_latency_us / tick_us),
      eccentricity_phase_(noise_.even()),
      lines_(sensors.encoder_lines) {
  const double range = sensors.current_range_a > 0.0 ? sensors.current_range_a : range_a;
  const double step = sensors.current_bits > 0 ? std::ldexp(2.0 * range, -sensors.current_bits) : 0.0;
  range_a_ = static_cast<float>(range);
  least_step_a_ = static_cast<float>(step);
  steps_per_a_ = step > 0.0 ? static_cast<float>(1.0 / step) : 0.0F;
  current_noise_a_ = static_cast<float>(sensors.current_noise * range);
  for (CurrentSensor& sensor : currents_) {
    sensor.offset_a = static_cast<float>(noise_.even() * sensors.current_offset * range);
    sensor.gain = static_cast<float>(1.0 + noise_.even() * sensors.current_gain_error);
  }
  const double counts_per_arcsec = counts_per_revolution / arcsec_per_turn;
  position_noise_counts_ = sensors.encoder_noise_arcsec * counts_per_arcsec;
  eccentricity_counts_ = sensors.eccentricity_arcsec * counts_per_arcsec;
  if (sensors.encoder_lines > 0) {
    once_counts_ = shares(sensors.interpolation_arcsec * counts_per_arcsec, noise_.even());
    twice_counts_ = shares(sensors.interpolation_second_arcsec * counts_per_arcsec, noise_.even());
  }
}

void Measurement::measure(const ShaftPlace& place, bool frozen, drive::Feedback& feedback) {
  const std::array<float, 4> noise = noise_.four();
  past_[++tick_ % past_ticks] = place;
  measure_currents(noise, feedback);
  if (!frozen) measure_position(place, static_cast<double>(noise[3]), feedback);
}

void Measurement::measure_currents(const std::array<float, 4>& noise, drive::Feedback& feedback) const {
  constexpr float no_fraction = 0x1.8p23F;  // adding and subtracting it rounds to an integer
  for (std::size_t phase = 0; phase < 3; ++phase) {
    const CurrentSensor& sensor = currents_[phase];
    float current = feedback.phase_current_a[phase] * sensor.gain + sensor.offset_a + current_noise_a_ * noise[phase];
    current = std::clamp(current, -range_a_, range_a_);
    const float steps = (current * steps_per_a_ + no_fraction) - no_fraction;
    feedback.phase_current_a[phase] = least_step_a_ > 0.0F ? steps * least_step_a_ : current;
  }
}

// Distance that the shaft has moved since the encoder sampled it.
double Measurement::latency_counts(const ShaftPlace& place) const {
  const auto since = [&](std::size_t ticks) {
    const ShaftPlace& then = past_[(tick_ + past_ticks - ticks) % past_ticks];
    return static_cast<double>(place.counts - then.counts) + (place.fraction - then.fraction);
  };
  const auto whole = static_cast<std::size_t>(latency_ticks_);
  const double newer = since(whole);
  return newer + (latency_ticks_ - static_cast<double>(whole)) * (since(whole + 1) - newer);
}

double Measurement::encoder_error_counts(double turns) const {
  double error = eccentricity_counts_ * static_cast<double>(at(turns + eccentricity_phase_).sine);
  if (lines_ > 0.0) {
    const drive::SinCos signal = at(lines_ * turns);
    const auto sine = static_cast<double>(signal.sine);
    const auto cosine = static_cast<double>(signal.cosine);
    error += once_counts_[0] * sine + once_counts_[1] * cosine + twice_counts_[0] * 2.0 * sine * cosine +
             twice_counts_[1] * (cosine - sine) * (cosine + sine);
  }
  return error;
}

void Measurement::measure_position(const ShaftPlace& place, double noise, drive::Feedback& feedback) const {
  const double late = latency_counts(place);
  const double off = place.fraction - late;
  const double turns = (static_cast<double>(feedback.single_turn_counts) + off) * turns_per_count_;
  const std::int64_t counts =
      drive::floor_to_integer(off + encoder_error_counts(turns) + position_noise_counts_ * noise);
  feedback.position_counts += counts;
  const auto turn = static_cast<std::int64_t>(counts_per_revolution_);
  std::int64_t single = static_cast<std::int64_t>(feedback.single_turn_counts) + counts;
  if (single < 0 || single >= turn) [[unlikely]]
    single = (single % turn + turn) % turn;
  feedback.single_turn_counts = static_cast<std::uint32_t>(single);
}

}  // namespace servodrome::plant
