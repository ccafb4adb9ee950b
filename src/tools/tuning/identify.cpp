// Identifies mechanics and controller from measured responses, by least squares.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tools/tuning/loop.hpp"

namespace servodrome::master::tuning {
namespace {

constexpr double turn = 2.0 * std::numbers::pi;

// Points with a lower coherence are ignored.
constexpr double least_coherence = 0.8;
// An elastic axis is assumed only if a rigid one has a misfit above rigid_misfit, and the elastic one is better by the
// factor `improvement`.
constexpr double improvement = 2.0;
constexpr double rigid_misfit = 0.05;
constexpr int refinements = 12;
// Ranges of the delays to try, in samples of the master and in seconds.
constexpr double most_command_samples = 6.0;
constexpr double most_loop_delay_s = 4e-3;

double weight_of(const ResponsePoint& point) {
  if (point.coherence < least_coherence) return 0.0;
  return std::min(point.coherence / (1.0 - std::min(point.coherence, 1.0 - 1e-9)), 1e3) * 1e-3 + 1e-3;
}

// Weighted least squares for real unknowns of complex equations.
template <std::size_t N>
class LeastSquares {
 public:
  void add(const std::array<Complex, N>& coefficients, Complex right, double weight) {
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t k = 0; k < N; ++k) {
        matrix_[i][k] += weight * (std::conj(coefficients[i]) * coefficients[k]).real();
      }
      right_[i] += weight * (std::conj(coefficients[i]) * right).real();
    }
    power_ += weight * std::norm(right);
  }
  // False: the equations do not determine the unknowns.
  bool solve(std::array<double, N>& unknowns) const {
    auto matrix = matrix_;
    auto right = right_;
    for (std::size_t i = 0; i < N; ++i) {
      std::size_t pivot = i;
      for (std::size_t k = i + 1; k < N; ++k) {
        if (std::abs(matrix[k][i]) > std::abs(matrix[pivot][i])) pivot = k;
      }
      std::swap(matrix[i], matrix[pivot]);
      std::swap(right[i], right[pivot]);
      if (!(std::abs(matrix[i][i]) > 1e-300)) return false;
      for (std::size_t k = i + 1; k < N; ++k) {
        const double factor = matrix[k][i] / matrix[i][i];
        for (std::size_t j = i; j < N; ++j) matrix[k][j] -= factor * matrix[i][j];
        right[k] -= factor * right[i];
      }
    }
    for (std::size_t i = N; i-- > 0;) {
      double sum = right[i];
      for (std::size_t k = i + 1; k < N; ++k) sum -= matrix[i][k] * unknowns[k];
      unknowns[i] = sum / matrix[i][i];
    }
    return true;
  }
  // Remaining power of the right side, relative.
  double remainder(const std::array<double, N>& unknowns) const {
    double explained = 0.0;
    for (std::size_t i = 0; i < N; ++i) {
      double row = -2.0 * right_[i];
      for (std::size_t k = 0; k < N; ++k) row += matrix_[i][k] * unknowns[k];
      explained += unknowns[i] * row;
    }
    return power_ > 0.0 ? std::max(0.0, 1.0 + explained / power_) : 1.0;
  }

 private:
  std::array<std::array<double, N>, N> matrix_{};
  std::array<double, N> right_{};
  double power_ = 0.0;
};

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

namespace {

struct DelayedGains {
  double kp = 0.0;
  double ki = 0.0;
  double remainder = 1.0;
};

// The measured torque is a sample, and so is the effect of the held command in it. Therefore the command enters with
// its full magnitude, without the factor of the hold.
DelayedGains gains_for(std::span<const ResponsePoint> velocity, std::span<const ResponsePoint> torque,
                       const std::optional<NotchSetting>& notch, double command_delay_s, double delay_s) {
  LeastSquares<2> equations;
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    const double f = velocity[i].frequency_hz;
    const double w = turn * f;
    const double weight = std::min(weight_of(velocity[i]), weight_of(torque[i]));
    if (weight <= 0.0) continue;
    const Complex error = std::polar(1.0, -w * command_delay_s) - velocity[i].response * std::polar(1.0, -w * delay_s);
    const Complex passed = notch ? error * notch->response(f) : error;
    equations.add({passed, passed / Complex(0.0, w)}, torque[i].response, weight / std::norm(torque[i].response));
  }
  std::array<double, 2> gains{};
  if (!equations.solve(gains)) return {};
  return {gains[0], gains[1], equations.remainder(gains)};
}

}  // namespace

std::optional<IdentifiedController> identify_controller(std::span<const ResponsePoint> velocity_by_command,
                                                        std::span<const ResponsePoint> torque_by_command,
                                                        double sample_s, const std::optional<NotchSetting>& notch) {
  if (velocity_by_command.size() != torque_by_command.size()) return std::nullopt;
  DelayedGains best;
  double command_delay_s = 0.0;
  double delay_s = 0.0;
  const auto attempt = [&](double command, double loop) {
    const DelayedGains found = gains_for(velocity_by_command, torque_by_command, notch, command, loop);
    if (found.remainder >= best.remainder || found.kp <= 0.0) return;
    best = found;
    command_delay_s = command;
    delay_s = loop;
  };
  // Searches a grid of both delays, and then finer grids around the best point: there is one minimum, but in a long
  // valley.
  double command_step = 0.25 * sample_s;
  double loop_step = 1e-4;
  for (double command = 0.0; command <= most_command_samples * sample_s; command += command_step) {
    for (double loop = 0.0; loop <= most_loop_delay_s; loop += loop_step) attempt(command, loop);
  }
  for (int round = 0; round < 12; ++round) {
    const double command = command_delay_s;
    const double loop = delay_s;
    for (int i = -3; i <= 3; ++i) {
      for (int k = -3; k <= 3; ++k) {
        attempt(std::max(0.0, command + i * command_step / 3.0), std::max(0.0, loop + k * loop_step / 3.0));
      }
    }
    command_step *= 0.6;
    loop_step *= 0.6;
  }
  if (best.remainder >= 1.0) return std::nullopt;
  return IdentifiedController{.controller = {best.kp, std::max(0.0, best.ki), delay_s, notch},
                              .command_delay_s = command_delay_s,
                              .misfit = std::sqrt(best.remainder)};
}

std::optional<IdentifiedLoop> identify_loop(std::span<const ResponsePoint> velocity_by_command,
                                            std::span<const ResponsePoint> torque_by_command, double sample_s,
                                            const std::optional<NotchSetting>& notch) {
  const auto controller = identify_controller(velocity_by_command, torque_by_command, sample_s, notch);
  if (!controller) return std::nullopt;
  const VelocityController& law = controller->controller;
  // Gains and notch without delay: the loop's delay is applied to the feedback only, because the command's delay
  // includes it.
  const VelocityController undelayed{law.kp, law.ki, 0.0, law.notch};
  const auto with_command_delay = [&](double delay_s) {
    IdentifiedLoop loop{.controller = *controller, .effective_delay_s = delay_s};
    for (std::size_t i = 0; i < velocity_by_command.size(); ++i) {
      const ResponsePoint& velocity = velocity_by_command[i];
      const double w = turn * velocity.frequency_hz;
      const Complex error = hold_gain(velocity.frequency_hz, sample_s) * std::polar(1.0, -w * delay_s) -
                            velocity.response * std::polar(1.0, -w * law.delay_s);
      loop.velocity_by_torque.push_back({velocity.frequency_hz,
                                         velocity.response / (undelayed.response(velocity.frequency_hz) * error),
                                         std::min(velocity.coherence, torque_by_command[i].coherence)});
    }
    return loop;
  };
  // Chooses the delay that gives the most plausible mechanics: the smallest misfit, with a rigid axis preferred.
  std::optional<IdentifiedLoop> best;
  double best_score = 0.0;
  double best_delay_s = controller->command_delay_s;
  const auto attempt = [&](double delay_s) {
    if (delay_s < 0.0) return;
    IdentifiedLoop loop = with_command_delay(delay_s);
    const auto mechanics = identify_mechanics(loop.velocity_by_torque);
    if (!mechanics) return;
    const double score = mechanics->misfit - (!mechanics->resonance && mechanics->misfit < rigid_misfit ? 1.0 : 0.0);
    if (best && score >= best_score) return;
    loop.mechanics = *mechanics;
    best = std::move(loop);
    best_score = score;
    best_delay_s = delay_s;
  };
  for (double step = 0.1 * sample_s, reach = 1.5 * sample_s; step > 1e-3 * sample_s; reach = step, step *= 0.2) {
    const double centre = best_delay_s;
    for (double offset = -reach; offset <= reach; offset += step) attempt(centre + offset);
  }
  return best;
}

}  // namespace servodrome::master::tuning
