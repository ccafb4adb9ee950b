#pragma once

#include "axis/cyclic/motion_axis.hpp"
#include "fibre.hpp"
#include "world.hpp"

namespace servodrome::chaos {

// Our masters, as programs that wait: each runs until World::stopping. They access the line only through their bus.

// Visits the drives of a CAN bus one after the other with SDOs: brings each into operation and moves it. On every
// second bus it also exchanges process data with a few of them for some seconds after each round.
void run_can_master(World& world, std::size_t bus, links::VirtualClock& clock);

// Moves the drives of the EtherCAT segment by process data. After an error that it cannot resolve it starts the segment
// again.
void run_ethercat_master(World& world, links::VirtualClock& clock);

// Gives one random command to an axis that is moved by process data: resets a fault, switches on, moves, or sometimes
// switches off at rest. Returns true if the drive is in operation and starts a move.
bool command_axis(Subject& subject, master::MotionAxis& axis, Random& random);
master::MotionLimits limits_of(const Subject& subject, double velocity_rps, double acceleration_rps2);

}  // namespace servodrome::chaos
