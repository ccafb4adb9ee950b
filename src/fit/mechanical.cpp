#include <algorithm>
#include <cmath>

#include "fit/models.hpp"

namespace servodrome::fit {

namespace {

enum class MechanicalTerm : std::uint8_t { inertia, viscous, coulomb, weight, delay };

constexpr double window_s = 40e-3;
constexpr double fewest_samples_in_window = 24.0;
constexpr double longest_mechanical_window_s = 0.5;
constexpr double settled = 1e-3;  // the iteration ends when the delay changes by less, in samples
constexpr double slow = 0.05;     // share of the greatest speed; below it the friction follows another law

}  // namespace

std::vector<double> velocity_of(const Signals& signals) {
  if (signals.has(Role::velocity)) return signals.of(Role::velocity);
  const std::vector<double>& position = signals.of(Role::position);
  const std::vector<double>& seconds = signals.seconds;
  // Distance in samples: long enough to average the steps of the encoder, short enough to keep the motion.
  const auto reach = static_cast<std::size_t>(std::clamp(1e-3 * signals.rate_hz(), 1.0, 16.0));
  std::vector<double> velocity;
  for (std::size_t i = 0; i < seconds.size(); ++i) {
    const std::size_t before = i >= reach ? i - reach : 0;
    const std::size_t after = std::min(i + reach, seconds.size() - 1);
    velocity.push_back((position[after] - position[before]) / (seconds[after] - seconds[before]));
  }
  return velocity;
}

Mechanical fit_mechanical(const Signals& signals, const std::vector<double>& torque_nm) {
  Mechanical result;
  const std::vector<double> velocity = velocity_of(signals);
  const Windows windows(
      signals.seconds, std::clamp(fewest_samples_in_window / signals.rate_hz(), window_s, longest_mechanical_window_s));
  std::vector<double> sign;
  double greatest = 0.0;
  for (const double v : velocity) {
    if (std::isfinite(v)) greatest = std::max(greatest, std::abs(v));
    sign.push_back(v > 0.0 ? 1.0 : v < 0.0 ? -1.0 : 0.0);
  }
  std::vector<double> least;
  std::vector<double> most;
  windows.range(velocity, least, most);
  std::vector<char> use(windows.size(), 0);
  for (std::size_t i = 0; i < use.size(); ++i) {
    use[i] = static_cast<char>(least[i] > slow * greatest || most[i] < -slow * greatest);
  }

  const std::vector<double> one(velocity.size(), 1.0);
  double delay = 0.0;
  std::vector<MechanicalTerm> active{MechanicalTerm::inertia, MechanicalTerm::viscous, MechanicalTerm::coulomb,
                                     MechanicalTerm::weight, MechanicalTerm::delay};
  double inertia = 0.0;  // latest value
  const auto equation = [&] {
    Equation made{.left = {{&torque_nm, 0, 1.0, delay}}, .columns = {}};
    const bool by_position = signals.has(Role::position);
    const std::vector<double>& way = by_position ? signals.of(Role::position) : velocity;
    const unsigned order = by_position ? 1 : 0;
    for (const MechanicalTerm column : active) {
      switch (column) {
        case MechanicalTerm::inertia: made.columns.push_back({{&way, order + 1}}); break;
        case MechanicalTerm::viscous: made.columns.push_back({{&way, order}}); break;
        case MechanicalTerm::coulomb: made.columns.push_back({{&sign}}); break;
        case MechanicalTerm::weight: made.columns.push_back({{&one}}); break;
        case MechanicalTerm::delay: made.columns.push_back({{&torque_nm, 1, 1.0, delay}}); break;
      }
      // The slope of the torque, predicted from the motion.
      const bool expected = column == MechanicalTerm::delay && inertia > 0.0;
      made.instruments.push_back(expected ? std::vector<Part>{{&way, order + 2, inertia}} : std::vector<Part>{});
    }
    return made;
  };
  const auto place = [&](MechanicalTerm column) {
    return static_cast<std::size_t>(std::find(active.begin(), active.end(), column) - active.begin());
  };
  const auto solve = [&] {
    Estimate estimate;
    for (unsigned step = 0; step < 8; ++step) {
      estimate = regress(windows, {equation()}, use);
      if (const std::size_t at = place(MechanicalTerm::inertia); at < active.size())
        inertia = estimate.unknowns[at].value;
      const std::size_t at = place(MechanicalTerm::delay);
      if (!estimate.solved || at == active.size()) break;
      const double change = estimate.unknowns[at].value;
      delay += change;
      if (std::abs(change) * signals.rate_hz() < settled) break;
      if (!(std::abs(delay) < windows.length_s())) {  // it diverges: the recording does not determine it
        delay = 0.0;
        estimate.unknowns[at].signal_share = 0.0;
        break;
      }
    }
    return estimate;
  };

  Estimate estimate = solve();
  // If columns cannot be separated, the fit removes the last of them and reports none of them.
  std::vector<MechanicalTerm> hidden;
  while (active.size() > 1) {
    if (estimate.windows < 3 * active.size()) break;
    std::vector<MechanicalTerm> vague;
    for (const MechanicalTerm column : active) {
      if (!shown(estimate.unknowns[place(column)])) vague.push_back(column);
    }
    if (vague.empty()) break;
    hidden.insert(hidden.end(), vague.begin(), vague.end());
    active.erase(active.begin() + static_cast<std::ptrdiff_t>(place(vague.back())));
    if (place(MechanicalTerm::delay) == active.size()) delay = 0.0;
    estimate = solve();
  }
  result.windows = estimate.windows;
  if (!estimate.solved) return result;
  result.residual_rms = estimate.residual_rms;
  const auto told = [&](MechanicalTerm column) -> std::optional<Unknown> {
    if (std::find(hidden.begin(), hidden.end(), column) != hidden.end() || place(column) == active.size()) return {};
    return estimate.unknowns[place(column)];
  };
  result.inertia = told(MechanicalTerm::inertia);
  result.viscous_friction = told(MechanicalTerm::viscous);
  result.coulomb_friction = told(MechanicalTerm::coulomb);
  result.weight = told(MechanicalTerm::weight);
  result.delay_s = told(MechanicalTerm::delay);
  if (result.delay_s) result.delay_s->value = delay;
  return result;
}

}  // namespace servodrome::fit
