#pragma once

#include "trajectory/trajectory.hpp"

// The types of the library trajectory that are part of the drive's own interface.
namespace servodrome::drive {

using trajectory::MotionLimits;
using trajectory::MotionState;
using trajectory::RampShape;
using trajectory::Trajectory;

}  // namespace servodrome::drive
