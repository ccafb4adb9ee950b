#pragma once

#include "line/bench/error.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// What GET /api/v1/axes/{axis} says of an axis: the drive as it sees itself, and the true shaft.
Json view_of(const Line& line, Axis& axis);

// The drive's active faults: [{"code": "0x7380", "name": ...}].
Json active_faults(Axis& axis);

}  // namespace servodrome::line::bench
