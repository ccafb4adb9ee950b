#pragma once

#include <string>
#include <variant>

#include "line/bench/api_names.hpp"
#include "line/line.hpp"

// The views and disturbances of buses in the API, for each kind of bus.
namespace servodrome::line::bench {

using AnyBus = std::variant<NamedBus*, NamedSerialBus*, NamedEthercatBus*>;

// Returns the bus that the argument names. Throws ApiError 404.
AnyBus bus_argument(Line& line, const Call& call);

Json view_of(const Line& line, const NamedBus& named);
Json view_of(const Line& line, const NamedSerialBus& named);
Json view_of(const Line& line, const NamedEthercatBus& named);

// Replaces the previous disturbance. On an error throws ApiError and changes nothing.
void disturb(const Line& line, const Call& call, NamedBus& named);
void disturb(const Line& line, const Call& call, NamedSerialBus& named);
void disturb(const Line& line, const Call& call, NamedEthercatBus& named);

// Ends all disturbances and reconnects the cables, except the one that closes a ring of EtherCAT.
void calm(const Line& line, NamedBus& named);
void calm(const Line& line, NamedSerialBus& named);
void calm(const Line& line, NamedEthercatBus& named);

Json view_of_link(const std::string& name, const links::LinkCounters& traffic);
template <typename Links>
Json view_of_links(const Links& links) {
  Json view = Json::array();
  for (const auto& link : links) view.push_back(view_of_link(link->name(), link->counters()));
  return view;
}

}  // namespace servodrome::line::bench
