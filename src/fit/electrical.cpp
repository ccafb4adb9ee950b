#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "fit/models.hpp"

namespace servodrome::fit {

namespace {

// Terms of the equations; terms that a recording does not determine are removed.
enum class ElectricalTerm : std::uint8_t { resistance, quadrature, direct, constant, drop, delay, frame };
constexpr std::size_t term_count = 7;

constexpr double samples_in_window = 48.0;
constexpr double shortest_window_s = 2e-3;
constexpr double longest_electrical_window_s = 60e-3;
// Relative to the quadrature current: a smaller direct current is only a control error, and cannot determine Ld.
constexpr double least_direct = 0.05;

// The fit tries soft currents of the stage (see share_of_drop) from this share of the greatest current upwards.
constexpr double softest = 0.01;
constexpr int soft_steps = 9;
constexpr double soft_ratio = 1.5;
// A drop below this share of the greatest voltage of the resistance is too small to determine the soft current.
constexpr double least_drop = 0.02;

// Fundamental of the voltage drop of the power stage along a current, relative to the fundamental at a high current.
// The drop of a half bridge is proportional to its current up to `soft_a`, the soft current, and constant above it.
double share_of_drop(double current_a, double soft_a) {
  const double x = current_a / soft_a;
  if (x <= 1.0) return 0.25 * std::numbers::pi * x;
  return 0.5 * (x * std::asin(1.0 / x) + std::sqrt(1.0 - 1.0 / (x * x)));
}

class Model {
 public:
  // `soft`: the soft current of the stage as a share of the greatest current.
  Model(const Signals& signals, const Motor& motor, double soft)
      : signals_(signals),
        count_(signals.seconds.size()),
        rotor_frame_(signals.has(Role::direct_voltage) && signals.has(Role::direct_current) && motor.pole_pairs),
        velocity_(velocity_of(signals)),
        windows_(signals.seconds,
                 std::clamp(samples_in_window / signals.rate_hz(), shortest_window_s, longest_electrical_window_s)),
        use_(windows_.size(), 1) {
    const std::vector<double>& iq = signals.of(Role::quadrature_current);
    const std::vector<double> none(count_, 0.0);
    const std::vector<double>& id = rotor_frame_ ? signals.of(Role::direct_current) : none;
    double backwards = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double product = signals.of(Role::quadrature_voltage)[i] * velocity_[i];
      if (std::isfinite(product)) backwards += product;
    }
    const double electrical = (backwards < 0.0 ? -1.0 : 1.0) * motor.pole_pairs.value_or(0);
    double greatest = 0.0;
    double power_q = 0.0;
    double power_d = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double current = std::hypot(iq[i], id[i]);
      if (!std::isfinite(current)) continue;
      greatest = std::max(greatest, current);
      power_q += iq[i] * iq[i];
      power_d += id[i] * id[i];
    }
    for (std::size_t i = 0; i < count_; ++i) {
      speed_.push_back(electrical * velocity_[i]);
      double warm = 1.0;
      if (signals.has(Role::temperature)) {
        const double kelvin = signals.of(Role::temperature)[i] - 25.0;
        if (std::isfinite(kelvin)) warm += motor.temperature_coefficient * kelvin;
      }
      heated_q_.push_back(warm * iq[i]);
      heated_d_.push_back(warm * id[i]);
      const double current = std::hypot(iq[i], id[i]);
      const double along = current > 0.0 ? share_of_drop(current, soft * greatest) / current : 0.0;
      sign_q_.push_back(along * iq[i]);
      sign_d_.push_back(along * id[i]);
      turning_q_.push_back(speed_[i] * iq[i]);
      turning_d_.push_back(speed_[i] * id[i]);
    }
    greatest_a_ = greatest;
    for (std::size_t i = 0; i < term_count; ++i) active_.push_back(static_cast<ElectricalTerm>(i));
    if (power_d < least_direct * least_direct * power_q) drop(ElectricalTerm::direct);
    if (!rotor_frame_) drop(ElectricalTerm::frame);
  }

  bool has(ElectricalTerm column) const { return std::find(active_.begin(), active_.end(), column) != active_.end(); }
  void drop(ElectricalTerm column) {
    active_.erase(std::remove(active_.begin(), active_.end(), column), active_.end());
    if (column == ElectricalTerm::delay) delay_ = 0.0;
    if (column == ElectricalTerm::frame) frame_ = 0.0;
  }

  // Gauss-Newton iteration: delay and rotation of the frame are nonlinear unknowns. They start at 0 and converge if the
  // true value is within a third of a window, which is sixteen samples.
  Estimate solve() {
    Estimate estimate;
    for (unsigned step = 0; step < most_steps; ++step) {
      turn_voltages();
      estimate = regress(windows_, equations(), use_);
      if (!estimate.solved) return estimate;
      for (std::size_t i = 0; i < active_.size(); ++i) {
        found_[static_cast<std::size_t>(active_[i])] = estimate.unknowns[i].value;
      }
      const auto move = [&](ElectricalTerm column, double& value) {
        if (!has(column)) return 0.0;
        const double change = unknown(estimate, column).value;
        value += change;
        return std::abs(change);
      };
      const double change = move(ElectricalTerm::delay, delay_) + move(ElectricalTerm::frame, frame_);
      if (change * signals_.rate_hz() < settled) break;
      // The iteration diverges: the recording does not determine these two unknowns.
      const bool lost = !(std::abs(delay_) + std::abs(frame_) < windows_.length_s());
      if (!lost) continue;
      delay_ = frame_ = 0.0;
      for (std::size_t i = 0; i < active_.size(); ++i) {
        if (active_[i] == ElectricalTerm::delay || active_[i] == ElectricalTerm::frame)
          estimate.unknowns[i].signal_share = 0.0;
      }
      break;
    }
    return estimate;
  }

  const Unknown& unknown(const Estimate& estimate, ElectricalTerm column) const {
    const auto place = std::find(active_.begin(), active_.end(), column) - active_.begin();
    return estimate.unknowns[static_cast<std::size_t>(place)];
  }
  std::optional<Unknown> shown_of(const Estimate& estimate, ElectricalTerm column) const {
    if (!has(column) || !shown(unknown(estimate, column))) return std::nullopt;
    return unknown(estimate, column);
  }
  double delay_s() const { return delay_; }
  double greatest_a() const { return greatest_a_; }
  const std::vector<ElectricalTerm>& active() const { return active_; }

 private:
  static constexpr unsigned most_steps = 12;
  static constexpr double settled = 1e-3;  // in samples

  // Rotates the voltages by the angle that the rotor turns during `frame_`.
  void turn_voltages() {
    const std::vector<double>& vq = signals_.of(Role::quadrature_voltage);
    voltage_q_.resize(count_);
    voltage_d_.resize(count_);
    moved_q_.resize(count_);
    moved_d_.resize(count_);
    for (std::size_t i = 0; i < count_; ++i) {
      const double vd = rotor_frame_ ? signals_.of(Role::direct_voltage)[i] : 0.0;
      const double angle = rotor_frame_ ? speed_[i] * frame_ : 0.0;
      voltage_d_[i] = vd * std::cos(angle) + vq[i] * std::sin(angle);
      voltage_q_[i] = vq[i] * std::cos(angle) - vd * std::sin(angle);
      moved_d_[i] = speed_[i] * voltage_q_[i];
      moved_q_[i] = speed_[i] * voltage_d_[i];
    }
  }

  // Slope of the voltage predicted from currents and speed with the values found so far; empty in the first step.
  std::vector<Part> expected_slope(bool quadrature) const {
    const double resistance = found_[static_cast<std::size_t>(ElectricalTerm::resistance)];
    const double q_inductance = found_[static_cast<std::size_t>(ElectricalTerm::quadrature)];
    const double d_inductance =
        has(ElectricalTerm::direct) ? found_[static_cast<std::size_t>(ElectricalTerm::direct)] : q_inductance;
    const double constant = found_[static_cast<std::size_t>(ElectricalTerm::constant)];
    if (resistance == 0.0) return {};
    if (!quadrature) {
      return {{&heated_d_, 1, resistance},
              {&signals_.of(Role::direct_current), 2, d_inductance},
              {&turning_q_, 1, -q_inductance}};
    }
    const bool by_position = signals_.has(Role::position);
    return {{&heated_q_, 1, resistance},
            {&signals_.of(Role::quadrature_current), 2, q_inductance},
            {&turning_d_, 1, d_inductance},
            {by_position ? &signals_.of(Role::position) : &velocity_, by_position ? 2U : 1U, constant}};
  }

  std::vector<Equation> equations() const {
    const auto& iq = signals_.of(Role::quadrature_current);
    const auto column = [&](ElectricalTerm which, bool quadrature) -> std::vector<Part> {
      const auto& id = rotor_frame_ ? signals_.of(Role::direct_current) : iq;
      const double direct_as_quadrature = rotor_frame_ && !has(ElectricalTerm::direct) ? 1.0 : 0.0;
      switch (which) {
        case ElectricalTerm::resistance: return {{quadrature ? &heated_q_ : &heated_d_}};
        case ElectricalTerm::quadrature:
          if (!quadrature) return {{&turning_q_, 0, -1.0}, {&id, 1, direct_as_quadrature}};
          return {{&iq, 1}, {&turning_d_, 0, direct_as_quadrature}};
        case ElectricalTerm::direct:
          if (!quadrature) return {{&id, 1}};
          return {{&turning_d_}};
        case ElectricalTerm::constant:
          if (!quadrature) return {};
          if (signals_.has(Role::position)) return {{&signals_.of(Role::position), 1}};
          return {{&velocity_}};
        case ElectricalTerm::drop: return {{quadrature ? &sign_q_ : &sign_d_}};
        case ElectricalTerm::delay: return {{quadrature ? &voltage_q_ : &voltage_d_, 1, 1.0, delay_}};
        case ElectricalTerm::frame:
          if (quadrature) return {{&moved_q_, 0, 1.0, delay_}};
          return {{&moved_d_, 0, -1.0, delay_}};
      }
      return {};
    };
    std::vector<Equation> equations;
    for (const bool quadrature : {true, false}) {
      if (!quadrature && !rotor_frame_) break;
      Equation& equation = equations.emplace_back();
      equation.left = {{quadrature ? &voltage_q_ : &voltage_d_, 0, 1.0, delay_}};
      for (const ElectricalTerm which : active_) {
        equation.columns.push_back(column(which, quadrature));
        equation.instruments.push_back(which == ElectricalTerm::delay ? expected_slope(quadrature)
                                                                      : std::vector<Part>{});
      }
    }
    return equations;
  }

  const Signals& signals_;
  std::size_t count_;
  bool rotor_frame_;  // values of both axes are known
  std::vector<double> velocity_;
  std::vector<double> speed_;  // electrical speed, with the direction of the phases
  std::vector<double> heated_q_;
  std::vector<double> heated_d_;
  std::vector<double> sign_q_;
  std::vector<double> sign_d_;
  std::vector<double> turning_q_;
  std::vector<double> turning_d_;
  std::vector<double> voltage_q_;
  std::vector<double> voltage_d_;
  std::vector<double> moved_q_;
  std::vector<double> moved_d_;
  Windows windows_;
  std::vector<char> use_;
  std::vector<ElectricalTerm> active_;
  std::array<double, term_count> found_{};  // latest value of each term
  double delay_ = 0.0;
  double frame_ = 0.0;
  double greatest_a_ = 0.0;
};

struct Attempt {
  Model model;
  Estimate estimate;

  bool loses() const {
    const auto drop = model.shown_of(estimate, ElectricalTerm::drop);
    const auto resistance = model.shown_of(estimate, ElectricalTerm::resistance);
    return drop && resistance && drop->value > least_drop * resistance->value * model.greatest_a();
  }
};

Attempt attempt(const Signals& signals, const Motor& motor, double soft) {
  Model model(signals, motor, soft);
  Estimate estimate = model.solve();
  // Removes terms that cannot be separated, beginning with the one that affects the others least.
  for (const ElectricalTerm column :
       {ElectricalTerm::direct, ElectricalTerm::drop, ElectricalTerm::frame, ElectricalTerm::delay}) {
    if (!model.has(column) || shown(model.unknown(estimate, column))) continue;
    model.drop(column);
    estimate = model.solve();
  }
  return {std::move(model), std::move(estimate)};
}

// Searches for the soft current with the smallest residuals of the voltages.
Attempt best_attempt(const Signals& signals, const Motor& motor) {
  std::optional<Attempt> best(attempt(signals, motor, softest));
  if (!best->loses()) return *std::move(best);
  double soft = softest;
  const auto improves = [&](double other) {
    Attempt next = attempt(signals, motor, other);
    if (!next.estimate.solved || next.estimate.residual_rms >= best->estimate.residual_rms) return false;
    best.emplace(std::move(next));
    soft = other;
    return true;
  };
  for (int step = 1; step <= soft_steps && improves(soft_ratio * soft); ++step) {
  }
  for (double ratio = soft_ratio; ratio > 1.05;) {
    ratio = std::sqrt(ratio);
    if (!improves(ratio * soft)) improves(soft / ratio);
  }
  return *std::move(best);
}

}  // namespace

Electrical fit_electrical(const Signals& signals, const Motor& motor) {
  Electrical result;
  const bool turns = signals.has(Role::velocity) || signals.has(Role::position);
  if (!signals.has(Role::quadrature_voltage) || !signals.has(Role::quadrature_current) || !turns) return result;
  const Attempt best = best_attempt(signals, motor);
  const auto& [model, estimate] = best;
  result.windows = estimate.windows;
  if (!estimate.solved) return result;
  result.residual_rms = estimate.residual_rms;
  result.resistance = model.shown_of(estimate, ElectricalTerm::resistance);
  result.quadrature_inductance = model.shown_of(estimate, ElectricalTerm::quadrature);
  result.direct_inductance = model.shown_of(estimate, ElectricalTerm::direct);
  result.voltage_constant = model.shown_of(estimate, ElectricalTerm::constant);
  result.stage_drop_v = model.shown_of(estimate, ElectricalTerm::drop);
  result.stage_loses = best.loses();
  result.delay_s = model.shown_of(estimate, ElectricalTerm::delay);
  if (result.delay_s) result.delay_s->value = model.delay_s();
  return result;
}

}  // namespace servodrome::fit
