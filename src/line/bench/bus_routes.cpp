#include <array>
#include <fmt/format.h>

#include "line/bench/body_reader.hpp"
#include "line/bench/buses.hpp"
#include "line/nearest_name.hpp"

namespace servodrome::line::bench {
namespace {

Json list_buses(Call& call) {
  Json buses = Json::array();
  for (const auto& bus : call.line.buses()) buses.push_back(view_of(call.line, *bus));
  for (const auto& bus : call.line.serial_buses()) buses.push_back(view_of(call.line, *bus));
  for (const auto& bus : call.line.ethercat_buses()) buses.push_back(view_of(call.line, *bus));
  return Json{{"buses", std::move(buses)}};
}

Json show_bus(Call& call) {
  return std::visit([&](auto* bus) { return view_of(call.line, *bus); }, bus_argument(call));
}

Json start_disturbance(Call& call) {
  return std::visit(
      [&](auto* bus) {
        disturb(call, *bus);
        return view_of(call.line, *bus);
      },
      bus_argument(call));
}

Json end_disturbance(Call& call) {
  return std::visit(
      [&](auto* bus) {
        BodyReader(call.body, true).finish();
        calm(call.line, *bus);
        return view_of(call.line, *bus);
      },
      bus_argument(call));
}

constexpr std::array bus_table{
    Route{Method::get, "/api/v1/buses", list_buses},
    Route{Method::get, "/api/v1/buses/{}", show_bus},
    Route{Method::post, "/api/v1/buses/{}/disturb", start_disturbance},
    Route{Method::delete_, "/api/v1/buses/{}/disturb", end_disturbance},
};

}  // namespace

AnyBus bus_argument(Call& call) {
  const std::string_view name = call.arguments.front();
  if (NamedBus* bus = call.line.find_bus(name)) return bus;
  if (NamedSerialBus* bus = call.line.find_serial_bus(name)) return bus;
  if (NamedEthercatBus* bus = call.line.find_ethercat_bus(name)) return bus;
  std::vector<std::string_view> names;
  for (const auto& bus : call.line.buses()) names.push_back(bus->settings.name);
  for (const auto& bus : call.line.serial_buses()) names.push_back(bus->settings.name);
  for (const auto& bus : call.line.ethercat_buses()) names.push_back(bus->settings.name);
  throw ApiError{404, fmt::format("there is no bus \"{}\"", name.substr(0, 40)), "address", suggestion(name, names)};
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

std::span<const Route> bus_routes() { return bus_table; }

}  // namespace servodrome::line::bench
