#pragma once

#include <string>
#include <vector>

#include "line/registry.hpp"
#include "line/table_reader.hpp"

namespace servodrome::line {

// Reads [axis.travel] into the plant's parameters: the axis' start position, hard stops and switches. Positions are in
// units of `counts_per_unit` encoder counts. Returns the keys of the fitted switches, in the order of
// Parameters::switches, for messages about them.
std::vector<std::string> read_travel(TableReader& travel, const Product& product, plant::Parameters& parameters);

}  // namespace servodrome::line
