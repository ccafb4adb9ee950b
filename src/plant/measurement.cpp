#include "plant/measurement.hpp"

#include <algorithm>
#include <cmath>

#include "drive/transforms.hpp"

namespace servodrome::plant {

namespace {

constexpr double arcsec_per_turn = 360.0 * 3600.0;
constexpr double tick_us = drive::tick_seconds * 1.0e6;

double sine_of(double turns) { return static_cast<double>(drive::sin_cos(drive::phase_of(turns)).sine); }

}  // namespace

Measurement::Measurement(const Sensors& sensors, std::int32_t counts_per_revolution, double range_a)
    : ideal_(sensors.ideal),
      noise_(sensors.seed),
      range_a_(sensors.current_range_a > 0.0 ? sensors.current_range_a : range_a),
      least_step_a_(sensors.current_bits > 0 ? std::ldexp(2.0 * range_a_, -sensors.current_bits) : 0.0),
      current_noise_a_(sensors.current_noise * range_a_),
      counts_per_revolution_(counts_per_revolution),
      latency_ticks_(sensors.encoder_latency_us / tick_us),
      position_noise_counts_(sensors.encoder_noise_arcsec / arcsec_per_turn * counts_per_revolution),
      eccentricity_counts_(sensors.eccentricity_arcsec / arcsec_per_turn * counts_per_revolution),
      eccentricity_phase_(noise_.even()),
      lines_(sensors.encoder_lines),
      interpolation_counts_{sensors.interpolation_arcsec / arcsec_per_turn * counts_per_revolution,
                            sensors.interpolation_second_arcsec / arcsec_per_turn * counts_per_revolution} {
  for (double& phase : interpolation_phase_) phase = noise_.even();
  for (CurrentSensor& sensor : currents_) {
    sensor.offset_a = noise_.even() * sensors.current_offset * range_a_;
    sensor.gain = 1.0 + noise_.even() * sensors.current_gain_error;
  }
}

void Measurement::measure(const ShaftPlace& place, bool frozen, drive::Feedback& feedback) {
  measure_currents(feedback);
  if (!frozen) measure_position(place, feedback);
  std::shift_right(before_.begin(), before_.end(), 1);
  before_.front() = place;
}

void Measurement::measure_currents(drive::Feedback& feedback) {
  for (std::size_t phase = 0; phase < 3; ++phase) {
    const CurrentSensor& sensor = currents_[phase];
    double current = static_cast<double>(feedback.phase_current_a[phase]) * sensor.gain + sensor.offset_a;
    if (current_noise_a_ > 0.0) current += current_noise_a_ * noise_.normal();
    if (least_step_a_ > 0.0) current = std::nearbyint(current / least_step_a_) * least_step_a_;
    feedback.phase_current_a[phase] = static_cast<float>(std::clamp(current, -range_a_, range_a_));
  }
}

// How far the shaft has moved since the encoder was read.
double Measurement::latency_counts(const ShaftPlace& place) {
  if (latency_ticks_ <= 0.0) return 0.0;
  const auto since = [&place](const ShaftPlace& then) {
    return static_cast<double>(place.counts - then.counts) + (place.fraction - then.fraction);
  };
  const auto whole = static_cast<std::size_t>(latency_ticks_);
  const double newer = whole == 0 ? 0.0 : since(before_[whole - 1]);
  const double older = since(before_[std::min(whole, longest_latency_ticks)]);
  return newer + (latency_ticks_ - static_cast<double>(whole)) * (older - newer);
}

double Measurement::encoder_error_counts(double turns) {
  double error = eccentricity_counts_ * sine_of(turns + eccentricity_phase_);
  if (lines_ > 0.0) {
    error += interpolation_counts_[0] * sine_of(lines_ * turns + interpolation_phase_[0]) +
             interpolation_counts_[1] * sine_of(2.0 * lines_ * turns + interpolation_phase_[1]);
  }
  if (position_noise_counts_ > 0.0) error += position_noise_counts_ * noise_.normal();
  return error;
}

void Measurement::measure_position(const ShaftPlace& place, drive::Feedback& feedback) {
  const double late = latency_counts(place);
  const double in_turn = static_cast<double>(feedback.single_turn_counts) + place.fraction - late;
  const double off = place.fraction - late + encoder_error_counts(in_turn / counts_per_revolution_);
  const auto counts = static_cast<std::int64_t>(std::floor(off));
  feedback.position_counts += counts;
  const auto turn = static_cast<std::int64_t>(counts_per_revolution_);
  const std::int64_t single = (static_cast<std::int64_t>(feedback.single_turn_counts) + counts) % turn;
  feedback.single_turn_counts = static_cast<std::uint32_t>(single < 0 ? single + turn : single);
}

}  // namespace servodrome::plant
