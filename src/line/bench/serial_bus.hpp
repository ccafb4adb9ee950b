#pragma once

#include "line/bench/routes.hpp"

// What the bench API does with an RS485 line; bus_routes.cpp does it with a CAN bus.
namespace servodrome::line::bench {

Json view_of_serial_bus(const Line& line, const NamedSerialBus& named);
// Replaces what was disturbed before.
Json disturb_serial_bus(Call& call, NamedSerialBus& named);
Json calm_serial_bus(Call& call, NamedSerialBus& named);

// A link of any bus.
Json view_of_link(const std::string& name, const links::LinkCounters& traffic);

}  // namespace servodrome::line::bench
