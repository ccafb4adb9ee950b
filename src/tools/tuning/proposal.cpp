#include "tools/tuning/proposal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace servodrome::master::tuning {
namespace {

// Demands on a proposal, the strictest first: minimum phase margin, and maximum gain of the open loop beyond the
// crossover, where a resonance may raise it.
struct Demand {
  double phase_margin;
  double gain_beyond;
};
constexpr std::array demands{Demand{52.0, 0.7}, Demand{45.0, 0.7}, Demand{45.0, 10.0}};
constexpr double most_sensitivity = 2.0;
// The proposal must keep the following margins if the inertia is higher or lower by this share: the load of an axis may
// change, and an identified inertia is not exact.
constexpr double inertia_error = 0.2;
constexpr double least_margin_then = 40.0;
constexpr double most_sensitivity_then = 2.5;
constexpr double position_share = 0.2;  // of the crossover frequency
// Corner frequency of the integral part, relative to the crossover; the fastest first.
constexpr std::array integral_ratios{0.25, 0.2, 0.15, 0.1, 0.06};
constexpr double bandwidth_tolerance = 1e-3;

// From 0.5 Hz to 5 kHz in steps of 1 %, narrower than any resonance of a machine.
const std::vector<double>& frequencies() {
  static const std::vector<double> all = [] {
    std::vector<double> list;
    for (double hz = 0.5; hz < 5000.0; hz *= 1.01) list.push_back(hz);
    return list;
  }();
  return all;
}

// Nyquist criterion: 1 + L starts near -180 degrees, because of the two integrators, and must end at 1 without
// encircling 0.
bool is_stable(const std::vector<Complex>& open_loop) {
  double angle = std::arg(1.0 + open_loop.front());
  if (angle > 0.0) angle -= turn;
  for (std::size_t i = 1; i < open_loop.size(); ++i) {
    angle += std::arg((1.0 + open_loop[i]) / (1.0 + open_loop[i - 1]));
  }
  return std::abs(angle) < 0.5 * std::numbers::pi;
}

std::vector<Complex> open_loop_of(const VelocityController& controller, const Mechanics& mechanics) {
  std::vector<Complex> open_loop;
  open_loop.reserve(frequencies().size());
  for (const double hz : frequencies()) open_loop.push_back(controller.response(hz) * mechanics.response(hz));
  return open_loop;
}

// For a given ratio of the integral, finds the gain by bisection of the bandwidth, which increases with it.
std::optional<Proposal> with_ratio(const Mechanics& mechanics, const Request& request, double ratio,
                                   const std::optional<NotchSetting>& notch) {
  const auto at = [&](double crossover) {
    const double kp = crossover * mechanics.inertia / std::hypot(1.0, ratio);
    return predict({kp, kp * crossover * ratio, request.delay, notch}, mechanics);
  };
  double low = 0.2 * turn * request.bandwidth_hz;
  double high = 1.5 * turn * request.bandwidth_hz;
  if (at(low).bandwidth_hz > request.bandwidth_hz) return std::nullopt;
  for (int i = 0; i < 40 && high / low > 1.0 + bandwidth_tolerance; ++i) {
    const double middle = std::sqrt(low * high);
    const double bandwidth = at(middle).bandwidth_hz;
    (bandwidth != 0.0 && bandwidth < request.bandwidth_hz ? low : high) = middle;
  }
  const Proposal found = at(low);
  if (std::abs(found.bandwidth_hz / request.bandwidth_hz - 1.0) > 0.02) return std::nullopt;
  return found;
}

bool holds_with_error(const VelocityController& controller, const Mechanics& mechanics) {
  for (const double factor : {1.0 - inertia_error, 1.0 + inertia_error}) {
    Mechanics other = mechanics;
    other.inertia *= factor;
    const std::vector<Complex> open_loop = open_loop_of(controller, other);
    const Margins margins = margins_of(frequencies(), open_loop);
    if (margins.phase_margin_deg.value_or(0.0) < least_margin_then) return false;
    if (margins.greatest_sensitivity > most_sensitivity_then || !is_stable(open_loop)) return false;
  }
  return true;
}

bool is_good(const Proposal& proposal, const Mechanics& mechanics, const Demand& demand) {
  if (proposal.margins.phase_margin_deg.value_or(0.0) < demand.phase_margin) return false;
  if (proposal.margins.greatest_sensitivity > most_sensitivity) return false;
  const std::vector<Complex> open_loop = open_loop_of(proposal.velocity, mechanics);
  // Applies above twice the crossover, where a loop without resonance has a gain of about 0.5.
  const double beyond_hz = 2.0 * proposal.margins.crossover_hz.value_or(0.0);
  for (std::size_t i = 0; i < open_loop.size(); ++i) {
    if (frequencies()[i] > beyond_hz && std::abs(open_loop[i]) > demand.gain_beyond) return false;
  }
  return is_stable(open_loop) && holds_with_error(proposal.velocity, mechanics);
}

}  // namespace

Proposal predict(const VelocityController& controller, const Mechanics& mechanics) {
  const std::vector<Complex> open_loop = open_loop_of(controller, mechanics);
  std::vector<Complex> closed(open_loop.size());
  std::transform(open_loop.begin(), open_loop.end(), closed.begin(), [](Complex loop) { return loop / (1.0 + loop); });
  Proposal proposal{.velocity = controller, .margins = margins_of(frequencies(), open_loop)};
  proposal.bandwidth_hz = bandwidth_of(frequencies(), closed).value_or(0.0);
  proposal.position_kp = position_share * turn * proposal.margins.crossover_hz.value_or(0.0);
  return proposal;
}

std::optional<Proposal> propose(const Mechanics& mechanics, const Request& request) {
  std::array<std::optional<NotchSetting>, 2> notches{};
  std::size_t tries = 1;
  if (request.notch && mechanics.resonance && mechanics.resonance->resonance_hz < request.notch->highest_hz) {
    const double hz = mechanics.resonance->resonance_hz;
    notches[1] = NotchSetting{hz, request.notch->relative_width * hz, request.notch->depth};
    tries = 2;
  }
  for (const Demand& demand : demands) {
    for (std::size_t i = 0; i < tries; ++i) {
      for (const double ratio : integral_ratios) {
        const auto found = with_ratio(mechanics, request, ratio, notches[i]);
        if (found && is_good(*found, mechanics, demand)) return found;
      }
    }
  }
  return std::nullopt;
}

double greatest_bandwidth(const Mechanics& mechanics, const Request& request) {
  Request lower = request;
  for (; lower.bandwidth_hz >= 1.0; lower.bandwidth_hz *= 0.95) {
    if (propose(mechanics, lower)) return lower.bandwidth_hz;
  }
  return 0.0;
}

}  // namespace servodrome::master::tuning
