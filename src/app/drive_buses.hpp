#pragma once

#include <vector>

#include "app/bus_options.hpp"
#include "studio/drive_bus.hpp"

namespace servodrome::app {

// The drives behind several --bus LINK[=NODE,NODE..]: those named, else all that are found. `common` is what the
// options have for all buses. Throws Failure for what is no link or has no drive, HostError if a bus cannot be opened.
std::vector<studio::BusPlan> find_drives(const std::vector<std::string>& buses, const BusOptions& common);

}  // namespace servodrome::app
