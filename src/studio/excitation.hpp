#pragma once

#include <functional>

#include "axis/axis402.hpp"

// Moves an axis so that a recording shows the response of its control loops: with a sine sweep or a step of velocity,
// torque or position.
namespace servodrome::studio {

struct Excitation {
  enum class Of { velocity, torque, position };
  Of of = Of::velocity;
  double amplitude = 0.0;  // in the drive's units of the target: 60FFh, 6071h, 607Ah
  double seconds = 0.0;
  // Share of the amplitude, -1 .. 1, as a function of the seconds since the start.
  std::function<double(double seconds)> shape{};
  // Greatest change of the shape per second. If the drive limits the target by a ramp, the ramp is set accordingly.
  double steepness = 0.0;
  // Units of the drive per revolution, per revolution/s and per revolution/s^2.
  catalogue::AxisUnits revolution{1.0, 1.0, 1.0};
  double travel = 0.0;  // permitted distance from the start position to either side, in the drive's units
};

// The greatest distance from the start position that the target alone commands, in the drive's units; 0 for a torque,
// whose motion depends on the load.
double commanded_distance(const Excitation& excitation);

// A sine sweep from `from_hz` to `to_hz`; its frequency grows exponentially.
std::function<double(double)> sine_sweep(double from_hz, double to_hz, double seconds);
// 1 for the first half of the time, then 0.
std::function<double(double)> step(double seconds);

// Excites an enabled axis. Afterwards the axis stands in mode profile velocity, even after a fault, after `cancelled`
// (throws master::Cancelled), or after leaving the permitted travel, which is an error. An axis that has left it brakes
// within another `travel`, as far as its torque permits. Restores the ramps. Throws master::MasterError.
void excite(master::Axis402& axis, const Excitation& excitation, const std::function<bool()>& cancelled);

}  // namespace servodrome::studio
