#include "fit/fit.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <numbers>

#include "fit/error.hpp"
#include "fit/models.hpp"

namespace servodrome::fit {

namespace {

constexpr std::array<ParameterText, parameter_count> texts{{
    {"resistance_ohm", "winding resistance R", "Ohm"},
    {"direct_inductance_h", "direct inductance Ld", "H"},
    {"quadrature_inductance_h", "quadrature inductance Lq", "H"},
    {"torque_constant_nm_per_a", "torque constant Kt", "Nm/A rms"},
    {"inertia_kgm2", "inertia J", "kgm2"},
    {"coulomb_friction_nm", "Coulomb friction", "Nm"},
    {"viscous_friction_nms", "viscous friction", "Nm s"},
    {"gravity_torque_nm", "weight (constant torque)", "Nm"},
    {"voltage_delay_s", "delay, voltage to current", "s"},
    {"torque_delay_s", "delay, torque to motion", "s"},
}};

// Text with the missing roles and, for each recorded but unusable column, the reason: "the position (column ...: ...)".
std::string missing(const Signals& signals, std::initializer_list<Role> roles) {
  std::vector<std::string> words;
  for (const Role role : roles) {
    if (signals.has(role)) continue;
    const auto place = static_cast<std::size_t>(role);
    if (signals.why_not[place].empty()) {
      words.emplace_back(text_of(role));
    } else {
      words.push_back(fmt::format("{} (column {}: {})", text_of(role), signals.columns[place], signals.why_not[place]));
    }
  }
  return fmt::format("{}", fmt::join(words, ", "));
}

void require_motion(const Signals& signals) {
  if (signals.seconds.size() < fewest_samples) {
    throw Error(signals.source, fmt::format("{} samples are too few", signals.seconds.size()),
                fmt::format("record at least {}, better some seconds at the highest rate", fewest_samples));
  }
  constexpr double slowest_hz = 10.0;
  if (signals.rate_hz() < slowest_hz) {
    throw Error(signals.source, fmt::format("the samples are {:.3g} s apart", 1.0 / signals.rate_hz()),
                "record at 50 Hz or more for the mechanics, at some kHz for the windings");
  }
  const bool by_position = signals.has(Role::position);
  if (!by_position && !signals.has(Role::velocity)) {
    throw Error(
        signals.source,
        "the motion of the shaft is unknown: " + missing(signals, {Role::position, Role::velocity}) + " missing",
        "record position or velocity, or give their column with --signal");
  }
  double low = 0.0;
  double high = 0.0;
  const std::vector<double>& seconds = signals.seconds;
  if (by_position) {
    low = std::numeric_limits<double>::infinity();
    high = -low;
    for (const double position : signals.of(Role::position)) {
      if (!std::isfinite(position)) continue;
      low = std::min(low, position);
      high = std::max(high, position);
    }
    if (low > high) low = high = 0.0;
  } else {
    const std::vector<double>& velocity = signals.of(Role::velocity);
    for (std::size_t i = 1; i < seconds.size(); ++i) {
      const double step = seconds[i] - seconds[i - 1];
      if (std::isfinite(velocity[i]) && step <= gap_s) high += std::abs(velocity[i]) * step;
    }
  }
  constexpr double least_way = 0.5;  // rad
  if (high - low > least_way) return;
  throw Error(signals.source,
              fmt::format("the shaft turns by no more than {:.3g} degrees", (high - low) * 180.0 / std::numbers::pi),
              "record while it moves, by several revolutions, both ways and with changes of speed (docs/fit.md has a "
              "motion)");
}

// Least reported uncertainty. The model uses only the mean of a voltage during a period, and the mean of a current
// between two samples.
constexpr double closest_share = 1e-3;
constexpr double closest_delay_periods = 0.05;

// The same if the power stage has a voltage drop: the model contains the drop's mean over an electrical turn, not its
// ripple.
constexpr double lossy_resistance_share = 0.015;
constexpr double lossy_inductance_share = 0.01;
constexpr double lossy_delay_periods = 0.25;

std::optional<Unknown> widened(std::optional<Unknown> found, double by) {
  if (found) found->half_width = std::hypot(found->half_width, by);
  return found;
}

class Report {
 public:
  Report(Result& result, double period_s) : result_(result), closest_delay_s_(closest_delay_periods * period_s) {
    for (std::size_t i = 0; i < parameter_count; ++i) {
      result.figures.push_back(
          {.parameter = static_cast<Parameter>(i), .value = {}, .half_width = 0.0, .why_not = {}, .remedy = {}});
    }
  }
  void tell(Parameter parameter, double value, double half_width) {
    Figure& figure = at(parameter);
    figure.value = value;
    const bool is_delay = parameter == Parameter::voltage_delay || parameter == Parameter::torque_delay;
    figure.half_width = std::hypot(half_width, is_delay ? closest_delay_s_ : closest_share * value);
  }
  void miss(std::initializer_list<Parameter> parameters, const std::string& why_not, const std::string& remedy) {
    for (const Parameter parameter : parameters) {
      if (at(parameter).value || !at(parameter).why_not.empty()) continue;
      at(parameter).why_not = why_not;
      at(parameter).remedy = remedy;
    }
  }
  // Reports the value if it was found, otherwise why it is missing.
  void put(Parameter parameter, const std::optional<Unknown>& found, const std::string& why_not,
           const std::string& remedy) {
    if (found) {
      tell(parameter, found->value, found->half_width);
    } else {
      miss({parameter}, why_not, remedy);
    }
  }

 private:
  Figure& at(Parameter parameter) { return result_.figures[static_cast<std::size_t>(parameter)]; }
  Result& result_;
  double closest_delay_s_;
};

// Adds a remark for each negative value of a parameter that is positive in every axis. The keys of a line file have
// limits, so toml_of changes negative values.
void remark_negative_values(Result& result) {
  using enum Parameter;
  for (const Parameter parameter :
       {resistance, direct_inductance, quadrature_inductance, coulomb_friction, viscous_friction}) {
    const Figure& figure = result.of(parameter);
    if (!figure.value || *figure.value + figure.half_width >= 0.0) continue;
    const ParameterText& about = text_of(parameter);
    result.remarks.push_back(fmt::format(
        "{} is negative beyond its uncertainty, {:.3g} +-{:.2g} {}, which no axis has: the sign of a channel "
        "or a unit may be wrong; correct it with --signal ROLE=COLUMN@UNIT (the unit -1Nm inverts a torque)",
        about.text, *figure.value, figure.half_width, about.unit));
  }
}

constexpr const char* more_changes = "record more changes of speed and of its direction (docs/fit.md)";

void report_electrical(const Signals& signals, const Electrical& found, Report& report, Result& result) {
  const auto voltage = {Role::quadrature_voltage, Role::quadrature_current};
  const std::string without = missing(signals, voltage);
  using enum Parameter;
  if (!without.empty()) {
    report.miss({resistance, direct_inductance, quadrature_inductance, torque_constant, voltage_delay},
                "not recorded: " + without,
                "record voltages and currents of the rotor's frame (vd, vq, id, iq), at some kHz");
    return;
  }
  const char* poor = "the recording does not show it";
  const auto of_stage = [&](const std::optional<Unknown>& figure, double share) {
    return widened(figure, found.stage_loses && figure ? share * figure->value : 0.0);
  };
  report.put(resistance, of_stage(found.resistance, lossy_resistance_share), poor,
             "record at several currents: different accelerations, some of them high");
  report.put(quadrature_inductance, of_stage(found.quadrature_inductance, lossy_inductance_share), poor,
             "give pole pairs and record vd and id too, at some kHz and with high accelerations at high speed");
  const double delay_s = found.stage_loses ? lossy_delay_periods / signals.rate_hz() : 0.0;
  report.put(voltage_delay, widened(found.delay_s, delay_s), poor,
             "record at a higher rate, with sudden changes of torque");
  if (found.direct_inductance) {
    report.put(direct_inductance, of_stage(found.direct_inductance, lossy_inductance_share), "", "");
  } else {
    report.miss({direct_inductance}, "without direct current it cannot be separated from Lq",
                "use Lq for it (a motor with surface magnets), or record with field weakening");
  }
  report.miss({torque_constant}, poor, "record at several speeds, both ways");
  result.electrical_rms_v = found.residual_rms;
  result.electrical_windows = found.windows;
  if (found.stage_drop_v) {
    result.stage_drop_v = found.stage_drop_v->value;
  } else if (found.resistance) {
    result.remarks.emplace_back(
        "R includes the voltage drop of the power stage: one current does not separate the two");
  }
}

}  // namespace

const ParameterText& text_of(Parameter parameter) { return texts[static_cast<std::size_t>(parameter)]; }

Result fit(const Signals& signals, const Motor& motor) {
  require_motion(signals);
  Result result;
  result.remarks = signals.remarks;
  Report report(result, 1.0 / signals.rate_hz());
  using enum Parameter;

  const Electrical electrical = fit_electrical(signals, motor);
  // Torque per A of amplitude is half the number of phases times the voltage constant. An A rms has sqrt(2) times the
  // amplitude.
  const double per_rms = 0.5 * motor.phases * std::numbers::sqrt2;
  if (electrical.voltage_constant) {
    const Unknown& constant = *electrical.voltage_constant;
    report.tell(torque_constant, std::abs(constant.value) * per_rms, constant.half_width * per_rms);
    result.turns_backwards = constant.value < 0.0;
  }
  report_electrical(signals, electrical, report, result);

  // Torque on the shaft in Nm, and the uncertainty of its scale.
  std::vector<double> torque_nm;
  double uncertain = 0.0;  // relative
  if (signals.has(Role::torque)) {
    torque_nm = signals.of(Role::torque);
  } else if (signals.has(Role::quadrature_current) && (electrical.voltage_constant || motor.torque_constant_nm_per_a)) {
    const double sign = result.turns_backwards.value_or(false) ? -1.0 : 1.0;
    double constant = motor.torque_constant_nm_per_a.value_or(0.0) / std::numbers::sqrt2 * sign;
    double reluctance = 0.0;
    if (electrical.voltage_constant) {
      constant = 0.5 * motor.phases * electrical.voltage_constant->value;
      uncertain = electrical.voltage_constant->half_width / std::abs(electrical.voltage_constant->value);
      if (electrical.direct_inductance && electrical.quadrature_inductance) {
        reluctance = 0.5 * motor.phases * sign * motor.pole_pairs.value_or(0) *
                     (electrical.direct_inductance->value - electrical.quadrature_inductance->value);
      }
    }
    const std::vector<double>& iq = signals.of(Role::quadrature_current);
    for (std::size_t i = 0; i < iq.size(); ++i) {
      const double id = reluctance != 0.0 ? signals.of(Role::direct_current)[i] : 0.0;
      torque_nm.push_back((constant + reluctance * id) * iq[i]);
    }
  }
  const auto mechanical_parameters = {inertia, coulomb_friction, viscous_friction, weight, torque_delay};
  if (torque_nm.empty()) {
    const bool only_constant = signals.has(Role::quadrature_current);
    report.miss(mechanical_parameters,
                only_constant
                    ? std::string("without a torque constant the torque cannot be calculated from the current")
                    : "not recorded: " + missing(signals, {Role::torque, Role::quadrature_current}),
                only_constant ? "record vq as well, or give --torque-constant" : "record torque or current");
  } else {
    const Mechanical found = fit_mechanical(signals, torque_nm);
    result.mechanical_rms_nm = found.residual_rms;
    result.mechanical_windows = found.windows;
    const auto put = [&](Parameter parameter, std::optional<Unknown> unknown, const char* why_not, const char* remedy) {
      if (unknown && parameter != torque_delay) {
        unknown->half_width = std::hypot(unknown->half_width, uncertain * unknown->value);
      }
      report.put(parameter, unknown, why_not, remedy);
    };
    if (found.inertia && found.inertia->value + found.inertia->half_width <= 0.0) {
      report.miss(mechanical_parameters, "the torque does not rise where the axis speeds up",
                  "its sign may be wrong: --signal torque=COLUMN@-1Nm inverts it");
      remark_negative_values(result);
      return result;
    }
    const char* together = "this motion does not separate it from the other parameters";
    put(inertia, found.inertia, "the speed hardly changes", "record while the axis speeds up and slows down");
    put(coulomb_friction, found.coulomb_friction, together, "record motion both ways, at two speeds or more");
    put(viscous_friction, found.viscous_friction, together, "record two speeds or more, the higher ones for longer");
    put(weight, found.weight, together, "record motion both ways");
    put(torque_delay, found.delay_s, together, more_changes);
  }
  remark_negative_values(result);
  return result;
}

}  // namespace servodrome::fit
