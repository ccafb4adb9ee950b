#include "routine.hpp"

#include <fmt/format.h>
#include <stdexcept>
#include <toml++/toml.h>

namespace examples {

namespace {

double number(const toml::table& table, const char* key, double otherwise = 0.0) {
  return table[key].value<double>().value_or(otherwise);
}

std::vector<std::uint32_t> words(const toml::table& table, const char* key) {
  std::vector<std::uint32_t> all;
  if (const toml::array* list = table[key].as_array()) {
    for (const toml::node& one : *list)
      all.push_back(static_cast<std::uint32_t>(one.value<std::int64_t>().value_or(0)));
  }
  return all;
}

Routine::Step step_of(const toml::table& table) {
  Routine::Step step;
  step.block = table["block"].value_or(std::string());
  step.position = number(table, table.contains("distance") ? "distance" : "position");
  step.velocity = number(table, "velocity");
  step.acceleration = number(table, "acceleration");
  step.deceleration = number(table, "deceleration", step.acceleration);
  step.direction = number(table, "direction", 1.0);
  step.turns = number(table, "turns");
  step.at = table["at"].value<double>();
  return step;
}

}  // namespace

Routine load_routine(const std::string& path) {
  try {
    const toml::table file = toml::parse_file(path);
    Routine routine;
    routine.title = file["title"].value_or(path);
    routine.model = file["model"].value_or("");
    routine.counts_per_unit = number(file, "counts_per_unit", 1.0);
    routine.outputs = words(file, "outputs");
    routine.inputs = words(file, "inputs");
    routine.home = number(file, "home");
    if (const toml::array* list = file["start_up"].as_array()) {
      for (const toml::node& row : *list) {
        const toml::array& cells = *row.as_array();
        const auto cell = [&](std::size_t i) { return cells[i].value<std::int64_t>().value_or(0); };
        routine.start_up.push_back({static_cast<std::uint16_t>(cell(0)), static_cast<std::uint8_t>(cell(1)), cell(2),
                                    static_cast<unsigned>(cell(3))});
      }
    }
    if (const toml::table* homing = file["homing"].as_table()) {
      routine.homing = {.by_drive = (*homing)["by"].value_or(std::string()) == "drive",
                        .bit = static_cast<unsigned>(number(*homing, "bit")),
                        .direction = number(*homing, "direction", 1.0),
                        .speed = number(*homing, "speed"),
                        .creep = number(*homing, "creep"),
                        .acceleration = number(*homing, "acceleration")};
    }
    if (const toml::array* list = file["program"].as_array()) {
      for (const toml::node& row : *list) routine.program.push_back(step_of(*row.as_table()));
    }
    return routine;
  } catch (const toml::parse_error& error) {
    throw std::runtime_error(fmt::format("{}: {} (line {})", path, error.description(), error.source().begin.line));
  }
}

}  // namespace examples
