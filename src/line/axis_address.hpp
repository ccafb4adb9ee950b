#pragma once

#include <string_view>
#include <vector>

#include "line/config.hpp"
#include "line/table_reader.hpp"

namespace servodrome::line {

// The names of the buses of all kinds.
std::vector<std::string_view> bus_names(const LineSettings& settings);

// Reads where an axis of a line file is: its bus of the product's kind, with node or position, and its RS485 line.
// `settings` must contain all buses and the axes before this one. Reports each error at its place in the file.
void read_axis_address(TableReader& reader, const LineSettings& settings, AxisSettings& axis);

}  // namespace servodrome::line
