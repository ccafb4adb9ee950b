#include <fmt/format.h>

#include "line/bench/axis_view.hpp"
#include "line/bench/buses.hpp"
#include "line/bench/line_bench.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::line::bench {

Json LineBench::list_buses(Call&) {
  Json buses = Json::array();
  for (const auto& bus : line_.buses()) buses.push_back(view_of(line_, *bus));
  for (const auto& bus : line_.serial_buses()) buses.push_back(view_of(line_, *bus));
  for (const auto& bus : line_.ethercat_buses()) buses.push_back(view_of(line_, *bus));
  return Json{{"buses", std::move(buses)}};
}

Json LineBench::show_bus(Call& call) {
  return std::visit([&](auto* bus) { return view_of(line_, *bus); }, bus_argument(line_, call));
}

// The devices of a virtual bus are known: a scan finds those that have power.
Json LineBench::scan_bus(Call& call) {
  BodyReader(call.body, true).finish();
  const Json bus = show_bus(call);
  const Json::json_pointer address(bus["type"] == "can"        ? "/node_id"
                                   : bus["type"] == "ethercat" ? "/position"
                                                               : "/serial/station");
  Json found = Json::array();
  for (const auto& [name, state] : bus["axes"].items()) {
    Axis& axis = *line_.find_axis(name);
    if (!axis.powered() || bus.value("cut", false) || state.value("cut", false)) continue;
    const Json view = view_of(line_, axis);
    found.push_back({{"address", view.at(address)},
                     {"name", ""},
                     {"kind", "servo drive (CiA 402)"},
                     {"product", view["product"]},
                     {"axis", name}});
  }
  return Json{{"found", std::move(found)}};
}

Json LineBench::start_disturbance(Call& call) {
  return std::visit(
      [&](auto* bus) {
        disturb(line_, call, *bus);
        return view_of(line_, *bus);
      },
      bus_argument(line_, call));
}

Json LineBench::end_disturbance(Call& call) {
  return std::visit(
      [&](auto* bus) {
        BodyReader(call.body, true).finish();
        calm(line_, *bus);
        return view_of(line_, *bus);
      },
      bus_argument(line_, call));
}

AnyBus bus_argument(Line& line, const Call& call) {
  const std::string_view name = call.arguments.front();
  if (NamedBus* bus = line.find_bus(name)) return bus;
  if (NamedSerialBus* bus = line.find_serial_bus(name)) return bus;
  if (NamedEthercatBus* bus = line.find_ethercat_bus(name)) return bus;
  std::vector<std::string_view> names;
  for (const auto& bus : line.buses()) names.push_back(bus->settings.name);
  for (const auto& bus : line.serial_buses()) names.push_back(bus->settings.name);
  for (const auto& bus : line.ethercat_buses()) names.push_back(bus->settings.name);
  throw ApiError{404, fmt::format("there is no bus \"{}\"", name.substr(0, 40)), "address",
                 links::suggestion(name, names)};
}

Json view_of_link(const std::string& name, const links::LinkCounters& traffic) {
  return Json{{"name", name},
              {"clients", traffic.clients},
              {"to_bus", traffic.to_bus},
              {"from_bus", traffic.from_bus},
              {"dropped", traffic.dropped},
              {"refused", traffic.refused},
              {"malformed", traffic.malformed}};
}

}  // namespace servodrome::line::bench
