#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "axis/axis_units.hpp"

// --units and related options: the units in which commands that move or show an axis read and print numbers.
namespace servodrome::app {

struct UnitOptions {
  std::string name = "drive";
  bool revolutions = false;
  std::optional<double> units_per_revolution{};
  std::optional<double> feed_mm{};

  // Throws Failure if the options contradict each other; needs no drive.
  master::UnitChoice choice() const;
};

// Throws MasterError if neither the drive nor the options give the size of a revolution.
master::UnitScale scale_of(master::Axis402& axis, const master::UnitChoice& choice);

void add_unit_options(CLI::App& command, UnitOptions& options);

}  // namespace servodrome::app
