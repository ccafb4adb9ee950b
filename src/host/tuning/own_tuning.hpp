#pragma once

#include "host/axis402.hpp"
#include "host/tuning/drive_gains.hpp"

// The drive's own automatic tuning, over any bus: it needs objects only.
namespace servodrome::host::tuning {

struct OwnTuningOptions {
  double travel_revolutions = 4.0;
  double seconds = 30.0;  // for the inertia
  std::function<void(const char* doing, double share)> progress{};
};

struct OwnTuningResult {
  std::vector<GainValue> before;
  std::vector<GainValue> after;
};

// iSMK (manual, ch. 6.1 and 6.2.1): learns the inertia (2340h sub 10h bits 0 and 1) while the axis is run to and
// fro in profile velocity, which adjusts kvp; then looks for resonances (60F9h sub 4 bit 7), which sets notch filters.
// The bandwidth is what the drive has (2FF0h sub 0Ah). On failure the old gains are put back; whatever happens the axis
// is stopped and disabled. Throws HostError, Cancelled as the axis' options say.
OwnTuningResult tune_by_itself(Axis402& axis, const TuningDialect& dialect, const AxisUnits& units,
                               const OwnTuningOptions& options);

}  // namespace servodrome::host::tuning
