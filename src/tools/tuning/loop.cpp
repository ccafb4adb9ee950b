#include "tools/tuning/loop.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace servodrome::master::tuning {
namespace {

constexpr double degrees = 180.0 / std::numbers::pi;
const double three_db = 1.0 / std::numbers::sqrt2;

// Frequency at which a magnitude crosses a level between two points, by logarithmic interpolation.
double crossing(double f0, double level0, double f1, double level1, double level) {
  const double share = std::log(level / level0) / std::log(level1 / level0);
  return f0 * std::pow(f1 / f0, std::clamp(share, 0.0, 1.0));
}

double angle_from_minus_one(Complex value) { return 180.0 - std::abs(std::arg(value)) * degrees; }

}  // namespace

std::vector<BodePoint> bode(std::span<const double> frequencies_hz, std::span<const Complex> response) {
  std::vector<BodePoint> points;
  for (std::size_t i = 0; i < std::min(frequencies_hz.size(), response.size()); ++i) {
    double phase = std::arg(response[i]) * degrees;
    if (points.empty()) {
      if (phase > 90.0) phase -= 360.0;
    } else {
      phase += 360.0 * std::round((points.back().phase_deg - phase) / 360.0);
    }
    points.push_back({frequencies_hz[i], 20.0 * std::log10(std::max(std::abs(response[i]), 1e-12)), phase});
  }
  return points;
}

Margins margins_of(std::span<const double> frequencies_hz, std::span<const Complex> open_loop) {
  Margins margins;
  for (std::size_t i = 0; i < open_loop.size(); ++i) {
    margins.greatest_sensitivity = std::max(margins.greatest_sensitivity, 1.0 / std::abs(1.0 + open_loop[i]));
  }
  for (std::size_t i = 1; i < open_loop.size(); ++i) {
    const double before = std::abs(open_loop[i - 1]);
    const double after = std::abs(open_loop[i]);
    if ((before >= 1.0) == (after >= 1.0) || before <= 0.0 || after <= 0.0) continue;
    const double share = std::log(1.0 / before) / std::log(after / before);
    // Change of phase between the two points, at most half a turn.
    const double bend = std::arg(open_loop[i] / open_loop[i - 1]);
    const double margin = angle_from_minus_one(open_loop[i - 1] * std::polar(1.0, bend * share));
    if (!margins.crossover_hz && before >= 1.0) {
      margins.crossover_hz = crossing(frequencies_hz[i - 1], before, frequencies_hz[i], after, 1.0);
    }
    margins.phase_margin_deg = std::min(margin, margins.phase_margin_deg.value_or(margin));
  }
  for (std::size_t i = 1; margins.crossover_hz && i < open_loop.size(); ++i) {
    const Complex before = open_loop[i - 1];
    const Complex after = open_loop[i];
    if (frequencies_hz[i] < *margins.crossover_hz || before.real() >= 0.0 || after.real() >= 0.0) continue;
    if ((before.imag() < 0.0) == (after.imag() < 0.0)) continue;
    const double share = before.imag() / (before.imag() - after.imag());
    margins.gain_margin_hz = frequencies_hz[i - 1] * std::pow(frequencies_hz[i] / frequencies_hz[i - 1], share);
    const double gain = std::abs(before) * std::pow(std::abs(after) / std::abs(before), share);
    margins.gain_margin_db = -20.0 * std::log10(gain);
    break;
  }
  return margins;
}

std::optional<double> bandwidth_of(std::span<const double> frequencies_hz, std::span<const Complex> closed_loop) {
  const std::size_t count = std::min(frequencies_hz.size(), closed_loop.size());
  for (std::size_t i = 1; i < count; ++i) {
    const double before = std::abs(closed_loop[i - 1]);
    const double after = std::abs(closed_loop[i]);
    if (before < three_db || after >= three_db) continue;
    if (i + 1 < count && std::abs(closed_loop[i + 1]) >= three_db) continue;
    return crossing(frequencies_hz[i - 1], before, frequencies_hz[i], after, three_db);
  }
  return std::nullopt;
}

double Mechanics::rotor_inertia() const {
  if (!resonance) return inertia;
  const double ratio = resonance->antiresonance_hz / resonance->resonance_hz;
  return inertia * ratio * ratio;
}

Complex Mechanics::response(double frequency_hz) const {
  const Complex s(0.0, turn * frequency_hz);
  const Complex rigid = 1.0 / (inertia * s);
  if (!resonance) return rigid;
  const auto factor = [s](double hz, double damping) {
    const Complex ratio = s / (turn * hz);
    return 1.0 + 2.0 * damping * ratio + ratio * ratio;
  };
  return rigid * factor(resonance->antiresonance_hz, resonance->antiresonance_damping) /
         factor(resonance->resonance_hz, resonance->resonance_damping);
}

Complex NotchSetting::response(double at_hz) const {
  const Complex s(0.0, at_hz);
  const Complex ends = s * s + frequency_hz * frequency_hz;
  return (ends + depth * width_hz * s) / (ends + width_hz * s);
}

Complex LoopDelay::response(double frequency_hz) const {
  const double w = turn * frequency_hz;
  return std::polar(1.0, -w * dead_s) / Complex(1.0, w * lag_s);
}

Complex VelocityController::response(double frequency_hz) const {
  const Complex proportional_integral = Complex(kp, -ki / (turn * frequency_hz)) * delay.response(frequency_hz);
  return notch ? proportional_integral * notch->response(frequency_hz) : proportional_integral;
}

}  // namespace servodrome::master::tuning
