#pragma once

#include <string>

#include "app/bus_options.hpp"
#include "axis/object_catalogue.hpp"
#include "tools/script/script.hpp"

namespace servodrome::app {

// Parses a motion script. `sheet` (--eds) gives names and types of the objects; nullptr: the products that the script
// and --product name, as their bus sees them, and the standard. Throws Failure with all mistakes, or for an unknown
// --product.
master::script::Script parse_script(const std::string& text, const std::string& name, const BusOptions& bus,
                                    const master::ObjectCatalogue* sheet);

}  // namespace servodrome::app
