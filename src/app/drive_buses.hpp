#pragma once

#include <vector>

#include "app/bus_options.hpp"
#include "studio/drive_bus.hpp"

namespace servodrome::app {

// Finds the drives behind several --bus LINK[=NODE,NODE..]: those that are named, otherwise all that a scan finds. A
// serial line is not scanned. `common` holds the options for all buses. Throws Failure for an invalid link or a bus
// without drives, MasterError if a bus cannot be opened.
std::vector<studio::BusPlan> find_drives(const std::vector<std::string>& buses, const BusOptions& common);

}  // namespace servodrome::app
