#pragma once

#include <functional>

#include "host/axis402.hpp"

// An axis is moved so that a recording of it tells how its loops answer: by a sweep of sines or by a step, of the
// velocity, of the torque or of the position.
namespace servodrome::studio {

struct Excitation {
  enum class Of { velocity, torque, position };
  Of of = Of::velocity;
  double amplitude = 0.0;  // in the drive's units of the target: 60FFh, 6071h, 607Ah
  double seconds = 0.0;
  // Share of the amplitude, -1 .. 1, at seconds after the begin.
  std::function<double(double seconds)> shape{};
  // Greatest change of the shape in a second: a drive that has the target only behind a ramp gets it this steep.
  double steepness = 0.0;
  double acceleration_per_velocity = 1.0;  // units of 6083h for one of 60FFh in a second
  double travel = 0.0;                     // to either side of where the axis stands, in the drive's units
};

// From `from_hz` to `to_hz`, at a rate of frequency that grows with it.
std::function<double(double)> sine_sweep(double from_hz, double to_hz, double seconds);
// 1 for half of the time, then 0.
std::function<double(double)> step(double seconds);

// The axis is enabled, and afterwards stands in profile velocity, whatever happened: a fault, `cancelled` (throws
// host::Cancelled), or leaving the travel, which is an error. Ramps are put back. Throws host::HostError.
void excite(host::Axis402& axis, const Excitation& excitation, const std::function<bool()>& cancelled);

}  // namespace servodrome::studio
