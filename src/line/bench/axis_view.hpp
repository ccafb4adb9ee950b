#pragma once

#include <functional>
#include <vector>

#include "drive/faults.hpp"
#include "drive/policy.hpp"
#include "line/bench/error.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// What GET /api/v1/axes/{axis} says of an axis: the drive as it sees itself, and the true shaft.
Json view_of(const Line& line, Axis& axis);

// "profile_position"
const char* mode_name(drive::Mode mode);

// What GET /api/v1/axes/{axis}/states says of a drive in a state, by the transitions that it accepts.
Json states_view(drive::PowerState state, const drive::Policy& policy,
                 const std::function<bool(const drive::Transition&)>& accepts);

// What GET /api/v1/axes/{axis}/homing says of a product. `reversed`: 607Eh turns the directions round.
Json homing_view(const drive::Policy& policy, bool reversed);

// What GET /api/v1/clock says.
Json clock_view(const Line& line);

// The drive's active faults; none without power.
std::vector<const drive::FaultRow*> active_faults(Axis& axis);
// What it warns of: motion goes on.
std::vector<const drive::FaultRow*> active_warnings(Axis& axis);
// {"code": "0x7380", "name": ...}
Json view_of(const drive::FaultRow& row);

}  // namespace servodrome::line::bench
