#pragma once

#include "line/config.hpp"
#include "line/table_reader.hpp"

namespace servodrome::line {

// Motor, load, supply, encoder, heat and travel of an axis of a line file, and what its drive is told of the motor.
// What cannot be is complained of where it stands.
void read_axis_plant(TableReader& reader, AxisSettings& axis);

}  // namespace servodrome::line
