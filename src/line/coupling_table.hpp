#pragma once

#include "line/config.hpp"
#include "line/table_reader.hpp"

namespace servodrome::line {

// Reads a table [[coupling]] into `settings`, whose buses and axes must be complete.
void read_coupling(TableReader& reader, LineSettings& settings);

}  // namespace servodrome::line
