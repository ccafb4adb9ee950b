#pragma once

#include <cmath>

#include "drive/loops_support.hpp"

namespace servodrome::drive::test {

// Crossover and phase margin of the velocity loop, opened at the measured velocity: a sine is added to the demand, and
// the loop's response is compared with it. Searches between the two frequencies; a crossover of 0 means that there is
// none.
struct Margin {
  double crossover_hz = 0.0;
  double degrees = 0.0;
};
inline Margin velocity_margin(Axis& axis, double from_hz, double to_hz) {
  axis.demand.loop = Loop::velocity;
  axis.run_seconds(0.2);
  const double amplitude = axis.counts_per_s(20.0);
  Margin margin;
  double gain_before = 0.0;
  double frequency_before = 0.0;
  double phase_before = 0.0;
  for (double frequency = from_hz; frequency < to_hz; frequency *= 1.05) {
    double demand_sine = 0.0, demand_cosine = 0.0, sine = 0.0, cosine = 0.0;
    const auto ticks_of = [](double seconds) { return std::lround(seconds / tick_seconds); };
    const auto periods = std::ceil(0.2 * frequency);
    const auto settle = ticks_of(std::ceil(0.1 * frequency) / frequency);
    const auto total = settle + ticks_of(periods / frequency);
    for (long k = 0; k < total; ++k) {
      const double angle = 2.0 * pi * frequency * static_cast<double>(k) * tick_seconds;
      axis.demand.velocity = static_cast<float>(amplitude * std::sin(angle));
      axis.cascade.set_demand(axis.demand);
      axis.cascade.tick(axis.feedback, axis.actuation);
      axis.plant.step(axis.actuation, axis.feedback);
      if (k < settle) continue;
      const double reference = static_cast<double>(axis.cascade.state().velocity_reference_counts_per_s);
      const double error = reference - static_cast<double>(axis.cascade.state().velocity_counts_per_s);
      const double measured = static_cast<double>(axis.cascade.state().velocity_counts_per_s);
      demand_sine += error * std::sin(angle), demand_cosine += error * std::cos(angle);
      sine += measured * std::sin(angle), cosine += measured * std::cos(angle);
    }
    const double gain = std::hypot(sine, cosine) / std::hypot(demand_sine, demand_cosine);
    double phase = std::atan2(cosine, sine) - std::atan2(demand_cosine, demand_sine);
    while (phase > 0.0) phase -= 2.0 * pi;
    while (phase < -2.0 * pi) phase += 2.0 * pi;
    if (gain < 1.0 && gain_before >= 1.0) {
      const double share = std::log(gain_before) / std::log(gain_before / gain);
      margin.crossover_hz = frequency_before * std::pow(frequency / frequency_before, share);
      margin.degrees = 180.0 + (phase_before + share * (phase - phase_before)) * 180.0 / pi;
      return margin;
    }
    gain_before = gain;
    frequency_before = frequency;
    phase_before = phase;
  }
  return margin;
}

}  // namespace servodrome::drive::test
