#pragma once

#include "host/tuning/session.hpp"
#include "studio/order.hpp"

namespace servodrome::studio {

struct TuningOrder {
  host::tuning::SessionRequest session{};
  host::tuning::TunerOptions tuner{};
  host::AxisUnits revolution{1.0, 1.0, 1.0};  // in the drive's units
};

// Measures the axis' velocity loop, proposes gains and, if asked to, writes them and measures what they make; what it
// found is in conduct.found, as `servodrome tune --json` prints it. The axis is disabled at the end. Throws HostError,
// with the old gains put back.
void tune_axis(host::Axis402& axis, const TuningOrder& order, Conduct& conduct);

// Lets the drive tune itself.
void let_axis_tune_itself(host::Axis402& axis, const TuningOrder& order, Conduct& conduct);

}  // namespace servodrome::studio
