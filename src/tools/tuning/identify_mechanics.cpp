// Identifies mechanics from their measured response, by least squares.
#include <algorithm>
#include <array>
#include <cmath>

#include "tools/tuning/least_squares.hpp"
#include "tools/tuning/loop.hpp"

namespace servodrome::master::tuning {
namespace {

constexpr int refinements = 12;

double misfit_of(const Mechanics& mechanics, std::span<const ResponsePoint> points) {
  double sum = 0.0;
  double weights = 0.0;
  for (const ResponsePoint& point : points) {
    const double weight = weight_of(point);
    if (weight <= 0.0 || point.response == Complex{}) continue;
    sum += weight * std::norm(mechanics.response(point.frequency_hz) / point.response - 1.0);
    weights += weight;
  }
  return weights > 0.0 ? std::sqrt(sum / weights) : 1.0;
}

// For a rigid axis acceleration divided by torque is 1/J.
std::optional<Mechanics> identify_rigid(std::span<const ResponsePoint> points) {
  LeastSquares<1> equations;
  for (const ResponsePoint& point : points) {
    const Complex acceleration = point.response * Complex(0.0, turn * point.frequency_hz);
    if (acceleration == Complex{}) continue;
    equations.add({1.0 / acceleration}, 1.0, weight_of(point));  // so that errors are relative
  }
  std::array<double, 1> by_inertia{};
  if (!equations.solve(by_inertia) || by_inertia[0] <= 0.0) return std::nullopt;
  Mechanics mechanics{.inertia = 1.0 / by_inertia[0]};
  mechanics.misfit = misfit_of(mechanics, points);
  return mechanics;
}

// Fits (b0 + b1 s + b2 s^2) / (1 + a1 s + a2 s^2). The equation multiplied out is linear in the coefficients; each step
// weights it by the denominator of the step before (C. K. Sanathanan, J. Koerner, 1963).
std::optional<Mechanics> identify_elastic(std::span<const ResponsePoint> points) {
  double logarithms = 0.0;
  unsigned count = 0;
  for (const ResponsePoint& point : points) {
    if (weight_of(point) <= 0.0) continue;
    logarithms += std::log(point.frequency_hz);
    ++count;
  }
  if (count < 8) return std::nullopt;
  const double unit_hz = std::exp(logarithms / count);
  std::array<double, 5> x{};  // b0 b1 b2 a1 a2
  for (int step = 0; step < refinements; ++step) {
    LeastSquares<5> equations;
    for (const ResponsePoint& point : points) {
      const double weight = weight_of(point);
      if (weight <= 0.0) continue;
      const Complex s(0.0, point.frequency_hz / unit_hz);
      const Complex y = point.response * Complex(0.0, turn * point.frequency_hz);
      const Complex denominator = step == 0 ? Complex(1.0) : 1.0 + x[3] * s + x[4] * s * s;
      const double scale = weight / std::max(std::norm(y * denominator), 1e-300);
      equations.add({1.0, s, s * s, -y * s, -y * s * s}, y, scale);
    }
    if (!equations.solve(x)) return std::nullopt;
  }
  if (!(x[0] > 0.0 && x[2] > 0.0 && x[4] > 0.0)) return std::nullopt;
  const double antiresonance = std::sqrt(x[0] / x[2]);
  const double resonance = std::sqrt(1.0 / x[4]);
  Mechanics mechanics{.inertia = 1.0 / x[0],
                      .resonance = Resonance{.antiresonance_hz = antiresonance * unit_hz,
                                             .antiresonance_damping = 0.5 * x[1] / x[0] * antiresonance,
                                             .resonance_hz = resonance * unit_hz,
                                             .resonance_damping = 0.5 * x[3] * resonance}};
  // An elastic coupling has its antiresonance below its resonance, and both are damped.
  const Resonance& found = *mechanics.resonance;
  if (found.antiresonance_hz >= found.resonance_hz || found.resonance_damping <= 0.0 ||
      found.antiresonance_damping <= 0.0) {
    return std::nullopt;
  }
  mechanics.misfit = misfit_of(mechanics, points);
  return mechanics;
}

}  // namespace

std::optional<Mechanics> identify_mechanics(std::span<const ResponsePoint> velocity_by_torque) {
  const auto rigid = identify_rigid(velocity_by_torque);
  if (rigid && rigid->misfit < rigid_misfit) return rigid;
  const auto elastic = identify_elastic(velocity_by_torque);
  if (elastic && (!rigid || improvement * elastic->misfit < rigid->misfit)) return elastic;
  return rigid;
}

}  // namespace servodrome::master::tuning
