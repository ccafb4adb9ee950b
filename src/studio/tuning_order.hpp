#pragma once

#include "catalogue/product.hpp"
#include "studio/order.hpp"
#include "tools/tuning/session.hpp"

namespace servodrome::studio {

struct TuningOrder {
  master::tuning::SessionRequest session{};
  master::tuning::TunerOptions tuner{};
  catalogue::AxisUnits revolution{1.0, 1.0, 1.0};  // size of a revolution in the drive's units
};

// Measures the axis' velocity loop, proposes gains and, if requested, writes them and measures their effect. The result
// is in conduct.found, in the form of `servodrome tune --json`. Disables the axis at the end. Throws MasterError after
// restoring the old gains.
void tune_axis(master::Axis402& axis, const TuningOrder& order, Conduct& conduct);

// Runs the drive's own automatic tuning.
void let_axis_tune_itself(master::Axis402& axis, const TuningOrder& order, Conduct& conduct);

}  // namespace servodrome::studio
