#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "host/axis_units.hpp"

// --units and related options: the units in which commands that move or show an axis read and print numbers.
namespace servodrome::app {

struct UnitOptions {
  std::string name = "drive";
  bool revolutions = false;
  std::optional<double> units_per_revolution{};
  std::optional<double> feed_mm{};

  // Throws Failure if the options contradict each other; needs no drive.
  host::UnitChoice choice() const;
};

// Throws HostError if neither the drive nor the options give the size of a revolution.
host::UnitScale scale_of(host::Axis402& axis, const host::UnitChoice& choice);

void add_unit_options(CLI::App& command, UnitOptions& options);

}  // namespace servodrome::app
