#include "fit/signals.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <numbers>
#include <set>

#include "fit/error.hpp"

namespace servodrome::fit {

namespace {

constexpr double turn = 2.0 * std::numbers::pi;

// The base of a unit, besides its factor.
enum class Scale : std::uint8_t { one, counts, rated_torque, rated_current };

struct Unit {
  std::string_view word;
  double factor;
  Scale scale;
};

struct RoleText {
  std::string_view word;
  std::string_view text;
  std::array<std::string_view, 4> names;  // names of columns, preferred ones first
  std::array<Unit, 10> units;
};

constexpr std::array<RoleText, role_count> roles{{
    {"position",
     "the position",
     {"position_counts", "position_actual_value", "position"},
     {{{"rad", 1, Scale::one},
       {"counts", 1, Scale::counts},
       {"pos", 1, Scale::counts},
       {"inc", 1, Scale::counts},
       {"UU", 1, Scale::counts},
       {"rev", turn, Scale::one},
       {"deg", turn / 360, Scale::one}}}},
    {"velocity",
     "the velocity",
     {"velocity_rpm", "velocity_actual_value", "velocity"},
     {{{"rad/s", 1, Scale::one},
       {"rpm", turn / 60, Scale::one},
       {"vel", 1, Scale::counts},
       {"inc/s", 1, Scale::counts},
       {"counts/s", 1, Scale::counts},
       {"UU/s", 1, Scale::counts},
       {"rps", turn, Scale::one},
       {"rev/s", turn, Scale::one}}}},
    {"torque",
     "the torque",
     {"torque_nm", "torque_actual_value", "torque", "torque_percent"},
     {{{"Nm", 1, Scale::one},
       {"mNm", 1e-3, Scale::one},
       {"%", 0.01, Scale::rated_torque},
       {"rated torque/1000", 1e-3, Scale::rated_torque}}}},
    {"iq",
     "the quadrature current (iq)",
     {"current_a", "quadrature_current_a", "iq", "current_actual_value"},
     {{{"A", 1, Scale::one},
       {"mA", 1e-3, Scale::one},
       {"Arms", std::numbers::sqrt2, Scale::one},
       {"%", 0.01, Scale::rated_current},
       {"rated current/1000", 1e-3, Scale::rated_current}}}},
    {"id",
     "the direct current (id)",
     {"direct_current_a", "id"},
     {{{"A", 1, Scale::one},
       {"mA", 1e-3, Scale::one},
       {"Arms", std::numbers::sqrt2, Scale::one},
       {"%", 0.01, Scale::rated_current}}}},
    {"vq",
     "the quadrature voltage (vq)",
     {"quadrature_voltage_v", "vq"},
     {{{"V", 1, Scale::one}, {"mV", 1e-3, Scale::one}}}},
    {"vd", "the direct voltage (vd)", {"direct_voltage_v", "vd"}, {{{"V", 1, Scale::one}, {"mV", 1e-3, Scale::one}}}},
    {"temperature", "the winding's temperature", {"temperature_c", "winding_temperature"}, {{{"degC", 1, Scale::one}}}},
}};

struct Found {
  const Column* column;
  std::string unit;
};

// The factor before a unit's word, and the word.
struct FactorAndWord {
  double factor = 1.0;
  std::string_view word;
  bool is_usable = true;  // the factor is finite, not 0, and of a sensible magnitude
};

FactorAndWord split_unit(std::string_view text) {
  FactorAndWord parts;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parts.factor);
  if (error != std::errc::invalid_argument) text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  while (text.starts_with(' ')) text.remove_prefix(1);
  parts.word = text;
  const double magnitude = std::abs(parts.factor);
  parts.is_usable = error != std::errc::result_out_of_range && magnitude >= 1e-15 && magnitude <= 1e15;
  return parts;
}

constexpr const char* what_a_factor_is = "the factor before a unit is a number from 1e-15 to 1e15, or its negative";

// Returns the factor to SI units; 0 if the conversion needs a value that is not given, which `why` names.
double factor_of(Role role, std::string_view text, const Motor& motor, std::string& why) {
  const auto [number, word, is_usable] = split_unit(text);
  const RoleText& about = roles[static_cast<std::size_t>(role)];
  if (!is_usable) {
    why = fmt::format("its unit is \"{}\", and {}: give it with --signal {}=COLUMN@UNIT", text, what_a_factor_is,
                      about.word);
    return 0.0;
  }
  const auto scaled = [&, number = number](const std::optional<double>& base, double share, const char* missing) {
    if (!base) why = fmt::format("it is in \"{}\", and {}", text, missing);
    return base ? number * share * *base : 0.0;
  };
  for (const Unit& unit : about.units) {
    if (unit.word.empty() || unit.word != word) continue;
    switch (unit.scale) {
      case Scale::one: return number * unit.factor;
      case Scale::counts: {
        const auto& counts = motor.counts_per_revolution;
        return scaled(counts ? std::optional(turn / *counts) : std::nullopt, unit.factor,
                      "the counts of a revolution are not known: give --counts-per-revolution");
      }
      case Scale::rated_torque:
        return scaled(motor.rated_torque_nm, unit.factor, "the rated torque is not known: give --rated-torque");
      case Scale::rated_current: {
        const auto& rated = motor.rated_current_a;
        return scaled(rated ? std::optional(*rated * std::numbers::sqrt2) : std::nullopt, unit.factor,
                      "the rated current is not known: give --rated-current");
      }
    }
  }
  std::vector<std::string_view> known;
  for (const Unit& unit : about.units) {
    if (!unit.word.empty()) known.push_back(unit.word);
  }
  why = fmt::format(
      "its unit \"{}\" is not known: give it with --signal {}=COLUMN@UNIT, units are {}, with a number before them if "
      "need be (0.1{})",
      text, about.word, fmt::join(known, ", "), known.front());
  return 0.0;
}

// Linear interpolation at the times of another clock; NaN outside the samples.
std::vector<double> resampled(const std::vector<double>& times, const std::vector<double>& values,
                              const std::vector<double>& at) {
  std::vector<double> result;
  result.reserve(at.size());
  std::size_t next = 0;
  for (const double time : at) {
    while (next < times.size() && times[next] < time) ++next;
    if (next < times.size() && times[next] == time) {
      result.push_back(values[next]);
    } else if (next == 0 || next == times.size()) {
      result.push_back(std::numeric_limits<double>::quiet_NaN());
    } else {
      const double share = (time - times[next - 1]) / (times[next] - times[next - 1]);
      result.push_back(values[next - 1] + share * (values[next] - values[next - 1]));
    }
  }
  return result;
}

std::string choose_axis(const Table& table, const std::string& axis) {
  std::set<std::string> axes;
  for (const Column& column : table.columns) axes.insert(column.axis);
  if (axes.size() == 1 && axis.empty()) return *axes.begin();
  if (axes.contains(axis) && !axis.empty()) return axis;
  if (axes.size() == 1 && axes.contains("")) {
    throw Error(table.source, fmt::format("--axis {}: the channels of this recording have no axis name", axis),
                "omit --axis");
  }
  throw Error(table.source,
              axis.empty() ? fmt::format("the recording is of {} axes", axes.size())
                           : fmt::format("the recording has no axis \"{}\"", axis),
              fmt::format("choose one with --axis: {}", fmt::join(axes, ", ")));
}

std::string names_in(const Table& table, const std::string& axis) {
  std::vector<std::string_view> names;
  for (const Column& column : table.columns) {
    if (column.axis == axis) names.push_back(column.name);
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

std::optional<Found> find_column(const Table& table, const std::string& axis, Role role,
                                 std::span<const Assignment> assignments) {
  const auto named = [&](std::string_view name) -> const Column* {
    for (const Column& column : table.columns) {
      if (column.axis == axis && column.name == name) return &column;
    }
    return nullptr;
  };
  for (const Assignment& assignment : assignments) {
    if (assignment.role != role) continue;
    const Column* column = named(plain_name(assignment.column));
    if (column == nullptr) {
      throw Error(table.source, fmt::format("there is no column \"{}\"", assignment.column),
                  "columns are " + names_in(table, axis));
    }
    return Found{column, assignment.unit.empty() ? column->unit : assignment.unit};
  }
  for (const std::string_view name : roles[static_cast<std::size_t>(role)].names) {
    const Column* column = name.empty() ? nullptr : named(name);
    if (column != nullptr) return Found{column, column->unit};
  }
  return std::nullopt;
}

// A drive's velocity may have other units than its position: then scales the velocity by comparing it with the
// position.
void compare_velocity(Signals& signals) {
  if (!signals.has(Role::position) || !signals.has(Role::velocity)) return;
  const std::vector<double>& position = signals.of(Role::position);
  std::vector<double>& velocity = signals.values[static_cast<std::size_t>(Role::velocity)];
  const std::size_t stride = std::max<std::size_t>(1, signals.seconds.size() / 200);
  double product = 0.0;
  double square = 0.0;
  for (std::size_t begin = 0; begin + stride < signals.seconds.size(); begin += stride) {
    double integral = 0.0;
    for (std::size_t i = begin; i < begin + stride; ++i) {
      const double step = signals.seconds[i + 1] - signals.seconds[i];
      integral +=
          step > gap_s ? std::numeric_limits<double>::quiet_NaN() : 0.5 * (velocity[i] + velocity[i + 1]) * step;
    }
    const double moved = position[begin + stride] - position[begin];
    if (!std::isfinite(integral + moved)) continue;
    product += moved * integral;
    square += integral * integral;
  }
  const double factor = square > 0.0 ? product / square : 0.0;
  if (!(std::abs(factor) > 1e-9) || std::abs(factor - 1.0) < 0.1) return;
  for (double& value : velocity) value *= factor;
  signals.remarks.push_back(
      fmt::format("the velocity does not match the position; it was multiplied by {:.5g} to match", factor));
}

// Converts the values to SI units. Throws Error for a magnitude that no axis has, because it would overflow in the sums
// of the fit.
void scale(Signals& signals, Role role, const Column& column, double factor) {
  constexpr double greatest = 1e20;
  std::vector<double>& values = signals.values[static_cast<std::size_t>(role)];
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double value = values[i] * factor;
    if (std::abs(value) > greatest) {
      throw Error(signals.source, fmt::format("column {} is {:g} at sample {}", column.name, values[i], i + 1),
                  "such a magnitude is no measurement: leave the field empty, or correct the unit with --signal");
    }
    values[i] = value;
  }
}

std::string span_of(const std::vector<double>& seconds) {
  return seconds.empty() ? "no sample" : fmt::format("{:g} to {:g} s", seconds.front(), seconds.back());
}

// `values`: those of `column` at the times of the column `first`.
void require_common_times(const Table& table, const Column& first, const Column& column,
                          const std::vector<double>& values) {
  const auto is_number = [](double value) { return std::isfinite(value); };
  if (std::any_of(values.begin(), values.end(), is_number)) return;
  if (std::none_of(column.values.begin(), column.values.end(), is_number)) {
    throw Error(table.source, fmt::format("column {} has no sample", column.name),
                "record it again, or select another column with --signal ROLE=COLUMN");
  }
  throw Error(table.source,
              fmt::format("the times of the columns {} ({}) and {} ({}) do not overlap", first.name,
                          span_of(table.clocks[first.clock]), column.name, span_of(table.clocks[column.clock])),
              "record both at the same time");
}

// A temperature changes slowly, so it may be sampled more rarely than the other signals.
void hold_temperature(Signals& signals) {
  std::vector<double>& values = signals.values[static_cast<std::size_t>(Role::temperature)];
  const auto first = std::find_if(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  if (first == values.end()) return;
  double latest = *first;
  for (double& value : values) {
    if (std::isfinite(value)) latest = value;
    value = latest;
  }
}

// A window with one missing value is unusable. So rows that lack a value are removed: samples need not be equidistant.
void keep_whole_rows(Signals& signals) {
  const std::size_t rows = signals.seconds.size();
  std::vector<char> whole(rows, 1);
  std::vector<std::string_view> names;
  for (std::size_t role = 0; role < role_count; ++role) {
    const std::vector<double>& values = signals.values[role];
    if (!values.empty()) names.push_back(signals.columns[role]);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i])) whole[i] = 0;
    }
  }
  const auto kept = static_cast<std::size_t>(std::count(whole.begin(), whole.end(), 1));
  if (kept == rows) return;
  if (kept == 0) {
    throw Error(signals.source, fmt::format("no sample has a value of all columns {}", fmt::join(names, ", ")),
                "record them at the same time");
  }
  const auto reduce = [&](std::vector<double>& values) {
    if (values.empty()) return;
    std::size_t next = 0;
    for (std::size_t i = 0; i < rows; ++i) {
      if (whole[i] != 0) values[next++] = values[i];
    }
    values.resize(next);
  };
  reduce(signals.seconds);
  for (std::vector<double>& values : signals.values) reduce(values);
  constexpr double remarkable = 0.05;
  const std::size_t removed = rows - kept;
  if (static_cast<double>(removed) < remarkable * static_cast<double>(rows)) return;
  signals.remarks.push_back(
      fmt::format("{} of {} samples lack a value of {}; they are left out", removed, rows, fmt::join(names, ", ")));
}

void remark_gaps(Signals& signals) {
  for (std::size_t i = 1; i < signals.seconds.size(); ++i) {
    const double step = signals.seconds[i] - signals.seconds[i - 1];
    if (step <= gap_s) continue;
    signals.remarks.push_back(
        fmt::format("a gap of {:.3g} s begins at {:.6g} s; the samples before and after it are used", step,
                    signals.seconds[i - 1]));
    if (signals.remarks.size() >= 8) return;
  }
}

}  // namespace

std::string_view word_of(Role role) { return roles[static_cast<std::size_t>(role)].word; }
std::string_view text_of(Role role) { return roles[static_cast<std::size_t>(role)].text; }

Assignment parse_assignment(std::string_view text) {
  const std::size_t equals = text.find('=');
  const std::string_view word = text.substr(0, equals);
  for (std::size_t role = 0; role < role_count && equals != std::string_view::npos; ++role) {
    if (roles[role].word != word) continue;
    const std::string_view rest = text.substr(equals + 1);
    const std::size_t at = std::min(rest.rfind('@'), rest.size());
    if (at == 0) break;
    if (!split_unit(rest.substr(std::min(at + 1, rest.size()))).is_usable) {
      throw Error(fmt::format("--signal {}", text), "its factor cannot be used",
                  fmt::format("{}, for example 0.1{}", what_a_factor_is, roles[role].units.front().word));
    }
    return {.role = static_cast<Role>(role),
            .column = std::string(rest.substr(0, at)),
            .unit = std::string(rest.substr(std::min(at + 1, rest.size())))};
  }
  std::vector<std::string_view> words;
  for (const RoleText& role : roles) words.push_back(role.word);
  throw Error(fmt::format("--signal {}", text), "this is not a ROLE=COLUMN or ROLE=COLUMN@UNIT",
              fmt::format("roles are {}", fmt::join(words, ", ")));
}

Signals signals_of(const Table& table, const Motor& motor, std::span<const Assignment> assignments,
                   const std::string& axis) {
  const std::string own = choose_axis(table, axis);
  std::array<std::optional<Found>, role_count> found;
  for (std::size_t role = 0; role < role_count; ++role) {
    found[role] = find_column(table, own, static_cast<Role>(role), assignments);
  }
  const auto any = std::find_if(found.rbegin(), found.rend(), [](const auto& one) { return one.has_value(); });
  if (any == found.rend()) {
    throw Error(table.source, "no column is a position, velocity, torque, current or voltage",
                fmt::format("assign columns with --signal ROLE=COLUMN@UNIT; columns are {}", names_in(table, own)));
  }
  // With several clocks, uses that of current or torque, because products of signals are formed at its samples.
  const auto clock_of = [&](Role role) { return found[static_cast<std::size_t>(role)]; };
  const Found& first = clock_of(Role::quadrature_current) ? *clock_of(Role::quadrature_current)
                       : clock_of(Role::torque)           ? *clock_of(Role::torque)
                                                          : **any;
  Signals signals{.source = table.source,
                  .seconds = table.clocks[first.column->clock],
                  .values = {},
                  .columns = {},
                  .why_not = {},
                  .remarks = {}};
  for (std::size_t role = 0; role < role_count; ++role) {
    if (!found[role]) continue;
    const Column& column = *found[role]->column;
    signals.columns[role] = column.name;
    const double factor = factor_of(static_cast<Role>(role), found[role]->unit, motor, signals.why_not[role]);
    if (factor == 0.0) continue;
    signals.values[role] = column.clock == first.column->clock
                               ? column.values
                               : resampled(table.clocks[column.clock], column.values, signals.seconds);
    scale(signals, static_cast<Role>(role), column, factor);
    require_common_times(table, *first.column, column, signals.values[role]);
  }
  hold_temperature(signals);
  keep_whole_rows(signals);
  remark_gaps(signals);
  compare_velocity(signals);
  return signals;
}

}  // namespace servodrome::fit
