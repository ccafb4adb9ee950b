#pragma once

#include <functional>
#include <vector>

#include "drive/faults.hpp"
#include "drive/policy.hpp"
#include "line/bench/api_names.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// The response to GET /api/v1/axes/{axis}: the state of the drive, and the true state of the shaft.
Json view_of(const Line& line, Axis& axis);

// "profile_position"
const char* mode_name(drive::Mode mode);

// The response to GET /api/v1/axes/{axis}/states for a drive in `state`, with the transitions that it accepts.
Json states_view(drive::PowerState state, const drive::Policy& policy,
                 const std::function<bool(const drive::Transition&)>& accepts);

// The response to GET /api/v1/axes/{axis}/homing. `reversed`: 607Eh reverses the directions.
Json homing_view(const drive::Policy& policy, bool reversed);

// The response to GET /api/v1/clock.
Json clock_view(const Line& line);

// The drive's active faults; empty without power.
std::vector<const drive::FaultRow*> active_faults(Axis& axis);
// The drive's active warnings, during which motion continues; empty without power.
std::vector<const drive::FaultRow*> active_warnings(Axis& axis);
// {"code": "0x7380", "name": ...}
Json view_of(const drive::FaultRow& row);

}  // namespace servodrome::line::bench
