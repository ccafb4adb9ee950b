// Identifies a sampled velocity loop from its responses, by least squares.
#include <cmath>
#include <numbers>

#include "tools/tuning/least_squares.hpp"
#include "tools/tuning/loop.hpp"

namespace servodrome::master::tuning {
namespace {

// Number of images (aliases) of each frequency in the model, on each side. The lag of the loop attenuates higher ones.
constexpr int images = 6;
// Ranges of the delays to start from, in samples of the master and in seconds.
constexpr double most_command_samples = 6.0;
constexpr double most_loop_delay_s = 4e-3;
constexpr double usual_delay_s = 0.2e-3;  // dead time and lag of a rigid axis, to start from
constexpr int most_steps = 40;
constexpr double least_progress = 1e-6;  // of a step, relative
constexpr double most_damping = 1e9;

struct Measured {
  std::span<const ResponsePoint> velocity;
  std::span<const ResponsePoint> torque;
  double sample_s;
};

// ---- Start values, computed without the images ----

struct StartGains {
  double kp = 0.0;
  double ki = 0.0;
  double remainder = 1.0;
};

// The torque is sampled, so the held command appears in it with its full magnitude: hold_gain() is not applied here.
StartGains gains_for(const Measured& measured, const std::optional<NotchSetting>& notch, double command_delay_s,
                     double delay_s) {
  LeastSquares<2> equations;
  for (std::size_t i = 0; i < measured.velocity.size(); ++i) {
    const ResponsePoint& velocity = measured.velocity[i];
    const ResponsePoint& torque = measured.torque[i];
    const double w = turn * velocity.frequency_hz;
    const double weight = std::min(weight_of(velocity), weight_of(torque));
    if (weight <= 0.0) continue;
    const Complex error = std::polar(1.0, -w * command_delay_s) - velocity.response * std::polar(1.0, -w * delay_s);
    const Complex passed = notch ? error * notch->response(velocity.frequency_hz) : error;
    equations.add({passed, passed / Complex(0.0, w)}, torque.response, weight / std::norm(torque.response));
  }
  std::array<double, 2> gains{};
  if (!equations.solve(gains)) return {};
  return {gains[0], gains[1], equations.remainder(gains)};
}

// Searches a grid of both delays.
std::optional<VelocityController> start_controller(const Measured& measured, const std::optional<NotchSetting>& notch) {
  StartGains best;
  double delay_s = 0.0;
  for (double command = 0.0; command <= most_command_samples; command += 0.25) {
    for (double loop = 0.0; loop <= most_loop_delay_s; loop += 1e-4) {
      const StartGains found = gains_for(measured, notch, command * measured.sample_s, loop);
      if (found.remainder >= best.remainder || found.kp <= 0.0) continue;
      best = found;
      delay_s = loop;
    }
  }
  if (best.remainder >= 1.0) return std::nullopt;
  return VelocityController{best.kp, std::max(best.ki, 0.1 * best.kp), {0.5 * delay_s, 0.5 * delay_s}, notch};
}

std::vector<ResponsePoint> mechanics_of(const Measured& measured, const VelocityController& law,
                                        double command_delay_s) {
  const VelocityController undelayed{law.kp, law.ki, {}, law.notch};
  std::vector<ResponsePoint> points;
  for (std::size_t i = 0; i < measured.velocity.size(); ++i) {
    const ResponsePoint& velocity = measured.velocity[i];
    const double hz = velocity.frequency_hz;
    const Complex error = hold_gain(hz, measured.sample_s) * std::polar(1.0, -turn * hz * command_delay_s) -
                          velocity.response * std::polar(1.0, -turn * hz * law.delay.total_s());
    points.push_back({hz, velocity.response / (undelayed.response(hz) * error),
                      std::min(velocity.coherence, measured.torque[i].coherence)});
  }
  return points;
}

// Chooses the delay of the command that gives the most plausible mechanics: the smallest misfit, with a rigid axis
// preferred.
std::optional<SampledLoop> start_of(const Measured& measured, const std::optional<NotchSetting>& notch) {
  const auto law = start_controller(measured, notch);
  if (!law) return std::nullopt;
  std::optional<SampledLoop> best;
  double best_score = 0.0;
  for (double samples = 0.0; samples <= most_command_samples + 1.5; samples += 0.1) {
    const double command_delay_s = samples * measured.sample_s;
    const auto mechanics = identify_mechanics(mechanics_of(measured, *law, command_delay_s));
    if (!mechanics) continue;
    const double score = mechanics->misfit - (!mechanics->resonance && mechanics->misfit < rigid_misfit ? 1.0 : 0.0);
    if (best && score >= best_score) continue;
    best_score = score;
    best = SampledLoop{.controller = *law,
                       .mechanics = *mechanics,
                       .velocity_delay_s = command_delay_s,
                       .torque_delay_s = command_delay_s};
  }
  return best;
}

// Start values for a rigid axis with typical delays. The gain is that of `start`; the crossover follows from the
// bandwidth.
SampledLoop rigid_start(SampledLoop start, const Measured& measured) {
  std::vector<double> frequencies_hz;
  std::vector<Complex> velocity;
  for (const ResponsePoint& point : measured.velocity) {
    frequencies_hz.push_back(point.frequency_hz);
    velocity.push_back(point.response);
  }
  const double bandwidth_hz = bandwidth_of(frequencies_hz, velocity).value_or(0.2 / measured.sample_s);
  const double crossover = turn * bandwidth_hz / std::numbers::sqrt2;
  VelocityController& law = start.controller;
  law = {law.kp, 0.2 * law.kp * crossover, {usual_delay_s, usual_delay_s}, law.notch};
  start.mechanics = {.inertia = law.kp / crossover};
  return start;
}

// ---- The fit: all unknowns together, with the images ----

// Gains, inertia, frequencies and dampings as logarithms; times in samples.
template <std::size_t N>
struct Unknowns {
  std::array<double, N> x{};

  Unknowns(const SampledLoop& loop, double sample_s) {
    const VelocityController& law = loop.controller;
    x = {std::log(loop.mechanics.inertia), std::log(law.kp),           std::log(law.ki),
         law.delay.dead_s / sample_s,      law.delay.lag_s / sample_s, loop.velocity_delay_s / sample_s,
         loop.torque_delay_s / sample_s};
    if constexpr (N > 7) {
      const Resonance& resonance = *loop.mechanics.resonance;
      x[7] = std::log(resonance.antiresonance_hz);
      x[8] = std::log(resonance.antiresonance_damping);
      x[9] = std::log(resonance.resonance_hz);
      x[10] = std::log(resonance.resonance_damping);
    }
  }
  // Keeps both parts of the loop's delay at 0 or above.
  void limit() { x[3] = std::max(x[3], 0.0), x[4] = std::max(x[4], 0.0); }
  SampledLoop loop(double sample_s, const std::optional<NotchSetting>& notch) const {
    SampledLoop loop{.controller = {std::exp(x[1]), std::exp(x[2]), {x[3] * sample_s, x[4] * sample_s}, notch},
                     .mechanics = {.inertia = std::exp(x[0])},
                     .velocity_delay_s = x[5] * sample_s,
                     .torque_delay_s = x[6] * sample_s};
    if constexpr (N > 7) {
      loop.mechanics.resonance = Resonance{std::exp(x[7]), std::exp(x[8]), std::exp(x[9]), std::exp(x[10])};
    }
    return loop;
  }
};

// Model divided by measurement, first all velocities, then all torques.
std::vector<Complex> ratios_of(const SampledLoop& loop, const Measured& measured) {
  const std::size_t count = measured.velocity.size();
  std::vector<Complex> ratios(2 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const SampledLoop::Response model = loop.response(measured.velocity[i].frequency_hz, measured.sample_s);
    ratios[i] = model.velocity / measured.velocity[i].response;
    ratios[count + i] = model.torque / measured.torque[i].response;
  }
  return ratios;
}

template <std::size_t N>
std::optional<SampledLoop> fit(const SampledLoop& start, const Measured& measured,
                               const std::function<void()>& between) {
  const std::size_t count = measured.velocity.size();
  const auto weight = [&](std::size_t i) {
    const ResponsePoint& point = i < count ? measured.velocity[i] : measured.torque[i - count];
    return point.response == Complex{} ? 0.0 : weight_of(point);
  };
  const auto misfit = [&](const std::vector<Complex>& ratios) {
    double sum = 0.0;
    double weights = 0.0;
    for (std::size_t i = 0; i < ratios.size(); ++i) {
      if (weight(i) <= 0.0) continue;
      sum += weight(i) * std::norm(ratios[i] - 1.0);
      weights += weight(i);
    }
    return weights > 0.0 ? std::sqrt(sum / weights) : 1.0;
  };
  const auto at = [&](const Unknowns<N>& unknowns) {
    return ratios_of(unknowns.loop(measured.sample_s, start.controller.notch), measured);
  };
  Unknowns<N> unknowns(start, measured.sample_s);
  std::vector<Complex> ratios = at(unknowns);
  double error = misfit(ratios);
  double damping = 1e-3;
  for (int step = 0; step < most_steps; ++step) {
    if (between) between();
    constexpr double difference = 1e-6;
    std::array<std::vector<Complex>, N> changed;
    for (std::size_t k = 0; k < N; ++k) {
      Unknowns<N> other = unknowns;
      other.x[k] += difference;
      changed[k] = at(other);
    }
    LeastSquares<N> equations;
    for (std::size_t i = 0; i < ratios.size(); ++i) {
      if (weight(i) <= 0.0) continue;
      std::array<Complex, N> slopes;
      for (std::size_t k = 0; k < N; ++k) slopes[k] = (changed[k][i] - ratios[i]) / difference;
      equations.add(slopes, 1.0 - ratios[i], weight(i));
    }
    const double before = error;
    for (; damping < most_damping; damping *= 4.0) {
      std::array<double, N> change{};
      if (!equations.solve(change, damping)) continue;
      Unknowns<N> other = unknowns;
      for (std::size_t k = 0; k < N; ++k) other.x[k] += change[k];
      other.limit();
      std::vector<Complex> now = at(other);
      const double its_error = misfit(now);
      if (!(its_error < error)) continue;
      unknowns = other;
      ratios = std::move(now);
      error = its_error;
      damping *= 0.2;
      break;
    }
    if (before - error < least_progress * before) break;
  }
  SampledLoop found = unknowns.loop(measured.sample_s, start.controller.notch);
  found.misfit = found.mechanics.misfit = error;
  if (!std::isfinite(error)) return std::nullopt;
  // An elastic coupling has its antiresonance below its resonance.
  const auto& resonance = found.mechanics.resonance;
  if (resonance && resonance->antiresonance_hz >= resonance->resonance_hz) return std::nullopt;
  return found;
}

// The torque is sampled up to a sample earlier or later than the position. The misfit has a local minimum between any
// two steps of the command, so the fit starts from several delays.
std::optional<SampledLoop> fit(SampledLoop start, const Measured& measured, const std::function<void()>& between) {
  std::optional<SampledLoop> best;
  for (const double samples : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
    start.torque_delay_s = start.velocity_delay_s + samples * measured.sample_s;
    const auto found = start.mechanics.resonance ? fit<11>(start, measured, between) : fit<7>(start, measured, between);
    if (found && (!best || found->misfit < best->misfit)) best = found;
  }
  return best;
}

}  // namespace

SampledLoop::Response SampledLoop::response(double frequency_hz, double sample_s) const {
  // The lag of the loop also delays the command. The dead time of the loop is left out here, because velocity_delay_s
  // and torque_delay_s contain it.
  const VelocityController alive{controller.kp, controller.ki, {.lag_s = controller.delay.lag_s}, controller.notch};
  Response sum{};
  for (int image = -images; image <= images; ++image) {
    const double hz = frequency_hz + image / sample_s;
    const double w = turn * hz;
    const Complex shaft = mechanics.response(hz);
    const Complex torque =
        hold_gain(std::abs(hz), sample_s) * alive.response(hz) / (1.0 + controller.response(hz) * shaft);
    const Response one{.velocity = torque * shaft * std::polar(1.0, -w * velocity_delay_s) * (frequency_hz / hz),
                       .torque = torque * std::polar(1.0, -w * torque_delay_s)};
    sum.velocity += one.velocity;
    sum.torque += one.torque;
    if (image == 0) sum.velocity_without_images = one.velocity;
  }
  return sum;
}

std::optional<IdentifiedLoop> identify_loop(std::span<const ResponsePoint> velocity_by_command,
                                            std::span<const ResponsePoint> torque_by_command, double sample_s,
                                            const std::optional<NotchSetting>& notch,
                                            const std::function<void()>& between) {
  if (velocity_by_command.size() != torque_by_command.size()) return std::nullopt;
  const Measured measured{velocity_by_command, torque_by_command, sample_s};
  auto start = start_of(measured, notch);
  if (!start) return std::nullopt;
  std::optional<SampledLoop> elastic;
  if (start->mechanics.resonance) elastic = fit(*start, measured, between);
  std::optional<SampledLoop> best = fit(rigid_start(*start, measured), measured, between);
  if (elastic && (!best || (best->misfit > rigid_misfit && improvement * elastic->misfit < best->misfit))) {
    best = elastic;
  }
  if (!best) return std::nullopt;
  IdentifiedLoop loop{*best};
  for (std::size_t i = 0; i < velocity_by_command.size(); ++i) {
    const double hz = velocity_by_command[i].frequency_hz;
    const SampledLoop::Response model = loop.response(hz, sample_s);
    const Complex velocity = velocity_by_command[i].response - (model.velocity - model.velocity_without_images);
    // Removes the delays outside of the loop; the result is L / (1 + L).
    const double outside_s = loop.velocity_delay_s - loop.controller.delay.dead_s;
    const Complex closed = velocity / hold_gain(hz, sample_s) * std::polar(1.0, turn * hz * outside_s);
    const Complex open = closed / (1.0 - closed);
    loop.closed_loop.push_back(closed);
    loop.open_loop.push_back(open);
    loop.velocity_by_torque.push_back({hz, open / loop.controller.response(hz),
                                       std::min(velocity_by_command[i].coherence, torque_by_command[i].coherence)});
  }
  return loop;
}

}  // namespace servodrome::master::tuning
