#pragma once

#include <algorithm>

#include "line/line.hpp"

namespace servodrome::line {

template <typename Buses>
bool any_link(const Buses& buses, bool (*is)(const links::LinkCounters& counters)) {
  return std::any_of(buses.begin(), buses.end(), [is](const auto& bus) {
    return std::any_of(bus->links.begin(), bus->links.end(), [is](const auto& link) { return is(link->counters()); });
  });
}

inline bool is_connected(const links::LinkCounters& counters) { return counters.clients > 0; }

inline bool has_can_clients(const Line& line) { return any_link(line.buses(), is_connected); }
// Clients of CAN buses and RS485 lines.
inline bool has_clients(const Line& line) {
  return has_can_clients(line) || any_link(line.serial_buses(), is_connected);
}
// A segment has no connections, so a master is assumed as soon as a frame has come. The line is then woken more often,
// so that it has less to catch up with before it answers a frame and the answer leaves sooner.
inline bool has_master(const Line& line) {
  return any_link(line.ethercat_buses(), [](const links::LinkCounters& counters) { return counters.to_bus > 0; });
}

}  // namespace servodrome::line
