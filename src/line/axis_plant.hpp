#pragma once

#include "line/config.hpp"
#include "line/table_reader.hpp"

namespace servodrome::line {

// Reads the motor, load, supply, encoder, heat and travel of an axis from a line file, and the motor data that its
// drive has. Reports each error at its place in the file.
void read_axis_plant(TableReader& reader, AxisSettings& axis);

}  // namespace servodrome::line
