#pragma once

#include "host/tuning/session.hpp"
#include "studio/order.hpp"

namespace servodrome::studio {

struct TuningOrder {
  host::tuning::SessionRequest session{};
  host::tuning::TunerOptions tuner{};
  host::AxisUnits revolution{1.0, 1.0, 1.0};  // size of a revolution in the drive's units
};

// Measures the axis' velocity loop, proposes gains and, if requested, writes them and measures their effect. The result
// is in conduct.found, in the form of `servodrome tune --json`. Disables the axis at the end. Throws HostError after
// restoring the old gains.
void tune_axis(host::Axis402& axis, const TuningOrder& order, Conduct& conduct);

// Runs the drive's own automatic tuning.
void let_axis_tune_itself(host::Axis402& axis, const TuningOrder& order, Conduct& conduct);

}  // namespace servodrome::studio
