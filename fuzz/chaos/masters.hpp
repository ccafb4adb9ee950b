#pragma once

#include "fibre.hpp"
#include "world.hpp"

namespace servodrome::chaos {

// Our masters, as programs that wait: each runs until World::stopping. They see the line only through their bus.

// Visits the drives of a CAN bus one after the other with SDOs: brings each into operation and moves it.
void run_can_master(World& world, std::size_t bus, links::VirtualClock& clock);

// Moves the drives of the EtherCAT segment by process data. After an error that it cannot overcome it starts the
// segment again.
void run_ethercat_master(World& world, links::VirtualClock& clock);

}  // namespace servodrome::chaos
