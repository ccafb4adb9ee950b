#pragma once

#include <string>

#include "line/config.hpp"
#include "studio/project/project.hpp"

namespace servodrome::app {

// How a line is served.
struct LineRun {
  std::string log{};                   // --log; empty: none
  std::string ready_file{};            // written when the line is ready; empty: none
  bool json = false;                   // print one JSON object when the line is ready, instead of a table
  studio::Project* project = nullptr;  // keeps the state of the page, changes and recordings; nullptr: none
};

// Serves a line with its API and page until a signal ends it. Throws Failure.
void run_line(const line::LineSettings& settings, const LineRun& how);

}  // namespace servodrome::app
