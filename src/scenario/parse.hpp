#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "line/diagnostic.hpp"
#include "line/table_reader.hpp"
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

// Reads rules that the user adds to a running scenario: the text contains [[rule]] tables and nothing else.
ScenarioFile parse_rules(std::string_view text, const std::string& file);

// Reads a scenario file from disk. If that fails, the result has a diagnostic.
ScenarioFile load_scenario(const std::string& path);

// The keys that the parser knows.
struct FormatKeys {
  std::map<std::string, std::vector<line::KeyNote>> tables;   // "" is the file; "rule", "condition" ...
  std::map<std::string, std::vector<line::KeyNote>> actions;  // of a rule, by the word of its action
};
FormatKeys format_keys();

}  // namespace servodrome::scenario
