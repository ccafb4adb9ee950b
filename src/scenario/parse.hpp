#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "line/diagnostic.hpp"
#include "scenario/scenario.hpp"

namespace servodrome::scenario {

struct ScenarioFile {
  Scenario scenario;                          // valid if there are no diagnostics
  std::vector<line::Diagnostic> diagnostics;  // in the order of the file
};

// Reads and checks the text of a scenario file (TOML, docs/scenario.md). `file` is its name in messages; the path of
// its line file starts at its folder. Whether names of axes, objects and faults exist is checked with the line:
// see Director.
ScenarioFile parse_scenario(std::string_view text, const std::string& file);

// Reads a scenario file from disk. If that fails, the result has a diagnostic.
ScenarioFile load_scenario(const std::string& path);

}  // namespace servodrome::scenario
