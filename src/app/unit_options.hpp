#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "host/axis_units.hpp"

// --units and what goes with it: in what the commands that move an axis, or show it, take and print numbers.
namespace servodrome::app {

struct UnitOptions {
  std::string name = "drive";
  bool revolutions = false;
  std::optional<double> units_per_revolution{};
  std::optional<double> feed_mm{};

  // Throws Failure if the options do not fit each other; asks no drive.
  host::UnitChoice choice() const;
};

// Throws HostError if the drive does not say what a revolution is, and the options neither.
host::UnitScale scale_of(host::Axis402& axis, const host::UnitChoice& choice);

void add_unit_options(CLI::App& command, UnitOptions& options);

}  // namespace servodrome::app
