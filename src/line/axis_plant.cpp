#include "line/axis_plant.hpp"

#include <charconv>
#include <cstring>
#include <fmt/format.h>

#include "line/travel.hpp"
#include "plant/doubts.hpp"

namespace servodrome::line {
namespace {

template <typename Struct, std::size_t Count>
void read_group(TableReader& axis, std::string_view key, Struct& target, const std::array<Key<Struct>, Count>& keys) {
  if (const toml::table* table = axis.table(key)) {
    TableReader reader(*table, axis.name_of(key), axis.report());
    reader.read(target, keys);
    reader.finish();
  }
}

void read_motor(TableReader& axis, plant::Motor& motor) {
  const toml::table* table = axis.table("motor");
  if (table == nullptr) return;
  TableReader reader(*table, axis.name_of("motor"), axis.report());
  reader.read(motor, motor_keys);
  for (const toml::table* harmonic : reader.tables("cogging")) {
    if (motor.cogging_count == motor.cogging.size()) {
      axis.report().complain(harmonic->source().begin, reader.name_of("cogging") + ": one table too many",
                             fmt::format("at most {}", motor.cogging.size()));
      break;
    }
    TableReader harmonic_reader(*harmonic, reader.name_of("cogging"), axis.report());
    harmonic_reader.read(motor.cogging[motor.cogging_count++], cogging_keys);
    harmonic_reader.finish();
  }
  reader.finish();
}

void read_nameplate(TableReader& axis, drive::MotorData& motor) {
  const std::size_t complaints = axis.report().diagnostics.size();
  read_group(axis, "nameplate", motor, nameplate_keys);
  const toml::table* table = axis.table("nameplate");
  if (table == nullptr || axis.report().diagnostics.size() != complaints) return;
  TableReader reader(*table, axis.name_of("nameplate"), axis.report());
  for (const Range& range : nameplate_ranges) {
    const auto value = (*table)[range.name].value<double>();
    if (!value || (*value >= range.minimum && *value <= range.maximum)) continue;
    reader.complain(range.name, fmt::format("{:g} is out of range", *value),
                    fmt::format("expected {:g} .. {:g}", range.minimum, range.maximum));
  }
}

struct PlantMessage {
  toml::source_position at;
  std::string text;
};

// Finds the place in the file to which `message` of plant::validate or plant::doubts refers. The message begins with
// the name of a parameter ("motor.pole_pairs: ...").
PlantMessage place_message(TableReader& axis, const std::string& message, const std::vector<std::string>& switches) {
  const std::size_t colon = message.find(": ");
  std::string name = message.substr(0, colon);
  const std::string what = colon == std::string::npos ? message : message.substr(colon + 2);
  if (name == "load.low_stop_counts") name = "travel.low_stop";
  if (name == "load.high_stop_counts") name = "travel.high_stop";
  if (name == "encoder.start_position_counts") name = "travel.start";
  if (name.starts_with("switches[")) {
    std::size_t number = 0;
    const std::string_view digits = std::string_view(name).substr(std::strlen("switches["));
    std::from_chars(digits.data(), digits.data() + digits.size(), number);
    name = number < switches.size() ? "travel." + switches[number] : "travel";
  }
  const std::string_view group = std::string_view(name).substr(0, name.find('.'));
  toml::source_position at = axis.place(group);
  const toml::table* table = axis.table(group);
  if (table != nullptr && group.size() < name.size()) {
    const std::string key = name.substr(group.size() + 1);
    // "key", or "key[number].member" in an array of tables
    if (const auto node = table->at_path(key)) {
      at = node.node()->source().begin;
    } else if (const auto element = table->at_path(key.substr(0, key.rfind('.')))) {
      at = element.node()->source().begin;
    }
  }
  return {at, fmt::format("axis.{}: {}", name, what)};
}

}  // namespace

void read_axis_plant(TableReader& reader, AxisSettings& axis) {
  const std::size_t complaints = reader.report().diagnostics.size();
  read_motor(reader, axis.plant.motor);
  read_group(reader, "load", axis.plant.load, load_keys);
  read_group(reader, "supply", axis.plant.supply, supply_keys);
  read_group(reader, "encoder", axis.plant.encoder, encoder_keys);
  read_group(reader, "thermal", axis.plant.thermal, thermal_keys);
  axis.plant.stage.ideal = axis.plant.sensors.ideal = false;  // unless the file says otherwise
  read_group(reader, "stage", axis.plant.stage, stage_keys);
  read_group(reader, "sensors", axis.plant.sensors, sensors_keys);
  bool ideal = false;
  reader.read("ideal", ideal);
  if (ideal) plant::remove_imperfections(axis.plant);
  std::vector<std::string> switches;
  const toml::table* travel = reader.table("travel");
  if (travel != nullptr && axis.product != nullptr) {
    TableReader travel_reader(*travel, reader.name_of("travel"), reader.report());
    switches = read_travel(travel_reader, *axis.product, axis.plant);
  }
  axis.motor_data = motor_data_of(axis.plant);
  read_nameplate(reader, axis.motor_data);
  if (reader.report().diagnostics.size() != complaints) return;  // the plant would report the same errors again
  FileReport& report = reader.report();
  for (const std::string& message : plant::validate(axis.plant)) {
    const auto [at, text] = place_message(reader, message, switches);
    report.complain(at, text, "docs/line-file.md lists the range of each parameter");
  }
  if (report.diagnostics.size() != complaints) return;
  for (const std::string& message : plant::doubts(axis.plant)) {
    const auto [at, text] = place_message(reader, message, switches);
    report.warn(at, text, "see docs/line-file.md, \"The plant\"");
  }
}

}  // namespace servodrome::line
