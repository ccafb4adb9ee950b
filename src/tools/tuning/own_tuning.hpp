#pragma once

#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "tools/tuning/drive_gains.hpp"

// The drive's own automatic tuning. It only needs access to objects, so it works on any bus.
namespace servodrome::master::tuning {

struct OwnTuningOptions {
  double travel_revolutions = 4.0;
  double seconds = 30.0;  // maximum time to learn the inertia
  std::function<void(const char* doing, double share)> progress{};
};

struct OwnTuningResult {
  std::vector<GainValue> before;
  std::vector<GainValue> after;
  bool inertia_settled = true;  // false: kvp still changed when the maximum time to learn the inertia was over
};

// iSMK (manual, ch. 6.1 and 6.2.1): the drive learns the inertia (2340h sub 10h bits 0 and 1) while the axis moves
// back and forth in profile velocity, and adjusts kvp. Then it searches for resonances (60F9h sub 4 bit 7) and sets
// notch filters. The bandwidth is the drive's setting (2FF0h sub 0Ah). On failure the old gains are restored; in any
// case the axis is stopped and disabled. Throws MasterError, or Cancelled by the options of the axis.
OwnTuningResult tune_by_itself(Axis402& axis, const catalogue::TuningDialect& dialect, const AxisUnits& units,
                               const OwnTuningOptions& options);

// Says that nothing was measured, whether the inertia may be wrong, and which gains of the velocity and position loops
// are lower than before.
std::string note_of(const OwnTuningResult& result);

}  // namespace servodrome::master::tuning
