// `fit`: estimates the parameters of an axis from a recording of its motion.
#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "app/commands.hpp"
#include "app/line_files.hpp"
#include "app/number_options.hpp"
#include "fit/error.hpp"
#include "fit/report.hpp"

namespace servodrome::app {
namespace fit_command {

using nlohmann::ordered_json;

struct Options {
  std::string file;
  std::string line_file;
  std::string axis;
  std::vector<std::string> signals;
  fit::Motor motor;
  std::optional<int> phases;
  bool json = false;
  bool toml = false;
};

std::string bytes_of(const std::string& path) {
  constexpr std::uintmax_t most_bytes = std::uintmax_t{512} << 20;
  std::error_code error;
  const std::uintmax_t size =
      std::filesystem::is_regular_file(path, error) ? std::filesystem::file_size(path, error) : 0;
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path, error)) {
    throw Failure::wrong_use(fmt::format("{}: cannot be read; check the path", path));
  }
  if (size > most_bytes) {
    throw Failure::wrong_use(
        fmt::format("{}: it is longer than {} MiB; record for a shorter time", path, most_bytes >> 20));
  }
  std::ostringstream text;
  text << file.rdbuf();
  return std::move(text).str();
}

// Fills parameters that no option gives from the line file.
void complete_by_line(fit::Motor& motor, const Options& options) {
  if (options.line_file.empty()) return;
  const line::LineSettings line = load_line(options.line_file);
  std::vector<std::string_view> names;
  const line::AxisSettings* found = nullptr;
  for (const line::AxisSettings& axis : line.axes) {
    names.push_back(axis.name);
    if (axis.name == options.axis || (options.axis.empty() && line.axes.size() == 1)) found = &axis;
  }
  if (found == nullptr) {
    throw Failure::wrong_use(
        fmt::format("{}: {}; choose one with --axis: {}", options.line_file,
                    options.axis.empty() ? "it has several axes" : fmt::format("there is no axis \"{}\"", options.axis),
                    fmt::join(names, ", ")));
  }
  const auto fill = [](auto& value, auto known) {
    if (!value) value = known;
  };
  // The drive scales its percentages with the motor data that were configured in it.
  const drive::MotorData& told = found->motor_data;
  fill(motor.rated_torque_nm, static_cast<double>(told.rated_torque_nm));
  fill(motor.rated_current_a, static_cast<double>(told.rated_current_a) / std::numbers::sqrt2);
  fill(motor.torque_constant_nm_per_a, found->plant.motor.torque_constant_nm_per_a);
  fill(motor.pole_pairs, found->plant.motor.pole_pairs);
  fill(motor.counts_per_revolution, static_cast<double>(found->plant.encoder.counts_per_revolution));
  fill(motor.rotor_inertia_kgm2, found->plant.motor.rotor_inertia_kgm2);
  motor.temperature_coefficient = found->plant.motor.copper_temperature_coefficient;
  motor.phases = found->plant.motor.phases;
}

ordered_json json_of(const fit::Signals& signals, const fit::Result& result, const fit::Motor& motor) {
  ordered_json json{{"file", signals.source}, {"samples", signals.seconds.size()}, {"rate_hz", signals.rate_hz()}};
  json["figures"] = ordered_json::array();
  for (const fit::Figure& figure : result.figures) {
    const fit::ParameterText& about = text_of(figure.parameter);
    ordered_json one{{"parameter", about.word}, {"name", about.text}, {"unit", about.unit}};
    if (figure.value) {
      one.update({{"value", *figure.value},
                  {"half_width_95", figure.half_width},
                  {"low", *figure.value - figure.half_width},
                  {"high", *figure.value + figure.half_width}});
    } else {
      one.update({{"value", nullptr}, {"why_not", figure.why_not}, {"remedy", figure.remedy}});
    }
    json["figures"].push_back(std::move(one));
  }
  const auto or_null = [](const auto& value) { return value ? ordered_json(*value) : ordered_json(nullptr); };
  json["stage_drop_v"] = or_null(result.stage_drop_v);
  json["turns_backwards"] = or_null(result.turns_backwards);
  json["residuals"] = {{"electrical_v", result.electrical_rms_v},
                       {"electrical_windows", result.electrical_windows},
                       {"mechanical_nm", result.mechanical_rms_nm},
                       {"mechanical_windows", result.mechanical_windows}};
  json["columns"] = ordered_json::object();
  for (std::size_t role = 0; role < fit::role_count; ++role) {
    if (!signals.has(static_cast<fit::Role>(role))) continue;
    json["columns"][std::string(word_of(static_cast<fit::Role>(role)))] = signals.columns[role];
  }
  json["remarks"] = result.remarks;
  json["toml"] = toml_of(result, motor);
  return json;
}

void run(const Options& options) {
  fit::Motor motor = options.motor;
  complete_by_line(motor, options);
  if (options.phases) motor.phases = *options.phases;
  std::optional<fit::Signals> signals;
  try {
    std::vector<fit::Assignment> assignments;
    for (const std::string& text : options.signals) assignments.push_back(fit::parse_assignment(text));
    const fit::Table table = fit::read_table(bytes_of(options.file), options.file);
    // With --line, --axis may be meant for the line file alone: recordings of one drive do not name their axis.
    const bool is_for_line =
        !options.line_file.empty() && std::all_of(table.columns.begin(), table.columns.end(),
                                                  [](const fit::Column& column) { return column.axis.empty(); });
    signals = signals_of(table, motor, assignments, is_for_line ? "" : options.axis);
  } catch (const fit::Error& error) {
    throw Failure::wrong_use(error.what());
  }
  fit::Result result;
  try {
    result = fit::fit(*signals, motor);
  } catch (const fit::Error& error) {
    throw Failure::did_not_work(error.what());
  }
  if (options.json) {
    fmt::print("{}\n", json_of(*signals, result, motor).dump(2, ' ', false, ordered_json::error_handler_t::replace));
  } else if (options.toml) {
    fmt::print("{}", toml_of(result, motor));
  } else {
    fmt::print("{}: {} samples in {:.3f} s, {:.1f} Hz\n{}", options.file, signals->seconds.size(),
               signals->seconds.back() - signals->seconds.front(), signals->rate_hz(), table_of(result));
  }
  const bool any = std::any_of(result.figures.begin(), result.figures.end(),
                               [](const fit::Figure& figure) { return figure.value.has_value(); });
  if (any) return;
  std::fflush(stdout);
  const fit::Figure& first = result.of(fit::Parameter::inertia);
  throw Failure::did_not_work(
      fmt::format("{}: no parameter can be identified: {}; {}", options.file, first.why_not, first.remedy));
}

}  // namespace fit_command

void add_fit(CLI::App& app) {
  const auto [command, options] =
      add_command(app, "fit",
                  "Identify the parameters of an axis from a recording of its motion: resistance, inductances, "
                  "torque constant, inertia, friction, weight and delays, each with its confidence interval (95 "
                  "%), and what to record for those that cannot be identified",
                  fit_command::run);
  command
      ->add_option("RECORDING", options->file,
                   "File of `scope -o` (.csv, .mcap), of the studio or the bench API, or the output of `scope --json`")
      ->required();
  command->add_option("--line", options->line_file,
                      "Line file with the motor data of the axis that are not in the recording");
  command->add_option("--axis", options->axis, "Axis, if the recording or the line file has several");
  command
      ->add_option("--signal", options->signals,
                   "ROLE=COLUMN or ROLE=COLUMN@UNIT: which column is position, velocity, torque, iq, id, vq, vd or "
                   "temperature, if its name is different; a unit may have a factor: vq=uq@0.1V")
      ->allow_extra_args(false);
  const auto add = [&to = *command](const char* name, std::optional<double>& value, double low, double high,
                                    const char* text) {
    to.add_option(name, value, text)->check(number_within(low, high));
  };
  add("--rated-torque", options->motor.rated_torque_nm, 1e-6, 1e5, "Rated torque in Nm, for torques in % of it");
  add("--rated-current", options->motor.rated_current_a, 1e-6, 1e4, "Rated current in A rms, for currents in % of it");
  add("--torque-constant", options->motor.torque_constant_nm_per_a, 1e-4, 1e3,
      "Torque constant in Nm per A rms, if no voltages were recorded to identify it");
  add("--counts-per-revolution", options->motor.counts_per_revolution, 1, 4294967296.0,
      "Counts of the encoder or units of the drive per revolution, for positions and velocities in these units");
  add("--rotor-inertia", options->motor.rotor_inertia_kgm2, 1e-8, 10,
      "Rotor inertia in kgm2; --toml then assigns the rest of the inertia to the load");
  command
      ->add_option("--pole-pairs", options->motor.pole_pairs,
                   "Pole pairs of the motor; with them the inductances can be identified from the speed")
      ->check(number_within(1, 100));
  command->add_option("--phases", options->phases, "Number of phases: 3, or 2 for windings in quadrature")
      ->check(number_within(2, 3));
  CLI::Option* json = command->add_flag("--json", options->json, "Print JSON");
  command->add_flag("--toml", options->toml, "Print the keys of a line file, ready to be pasted")->excludes(json);
}

}  // namespace servodrome::app
