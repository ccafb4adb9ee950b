#pragma once

#include <string_view>
#include <vector>

#include "line/config.hpp"
#include "line/table_reader.hpp"

namespace servodrome::line {

// Names of the buses of all kinds.
std::vector<std::string_view> bus_names(const LineSettings& settings);

// Where an axis of a line file is: on which bus of the product's kind and at which node or place, and on which RS485
// line. `settings` has all the buses and the axes before it. What cannot be is complained of where it stands.
void read_axis_address(TableReader& reader, const LineSettings& settings, AxisSettings& axis);

}  // namespace servodrome::line
