#include <fmt/format.h>

#include "line/bench/buses.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::line::bench {
namespace {

const char* word(links::ErrorState state) {
  switch (state) {
    case links::ErrorState::active: return "active";
    case links::ErrorState::passive: return "passive";
    case links::ErrorState::bus_off: return "bus_off";
  }
  return "unknown";
}

std::size_t index_of(const Line& line, const NamedBus& bus) {
  std::size_t index = 0;
  while (line.buses()[index].get() != &bus) ++index;
  return index;
}

Json view_of_port(const links::CanBus& bus, links::PortId port) {
  const links::PortCounters& counters = bus.counters(port);
  return Json{{"error_state", word(bus.error_state(port))},
              {"cut", bus.is_cut(port)},
              {"sent", counters.sent},
              {"received", counters.received},
              {"refused", counters.refused},
              {"discarded", counters.discarded},
              {"errors", counters.errors},
              {"transmit_errors", counters.transmit_errors},
              {"receive_errors", counters.receive_errors}};
}

Json view_of_disturbance(const links::Disturbance& disturbance) {
  return Json{{"drop", disturbance.drop},
              {"delay", disturbance.delay},
              {"delay_ms", std::chrono::duration<double, std::milli>(disturbance.delay_time).count()},
              {"corrupt", disturbance.corrupt},
              {"seed", disturbance.seed},
              {"id", disturbance.id},
              {"id_mask", disturbance.id_mask},
              {"limit", disturbance.limit}};
}

// Returns the axis of this bus that the key "axis" names, or nullptr without this key.
const Axis* named_axis(const Line& line, const NamedBus& named, BodyReader& body) {
  const auto name = body.string("axis");
  if (!name) return nullptr;
  std::vector<std::string_view> names;
  for (const auto& axis : line.axes()) {
    if (axis->settings().bus != index_of(line, named)) continue;
    if (axis->settings().name == *name) return axis.get();
    names.push_back(axis->settings().name);
  }
  throw ApiError{422, fmt::format("there is no axis \"{}\" on this bus", name->substr(0, 40)), "axis",
                 links::suggestion(*name, names)};
}

}  // namespace

Json view_of(const Line& line, const NamedBus& named) {
  const links::CanBus& bus = named.bus;
  const links::BusCounters& counters = bus.counters();
  Json view{{"name", named.settings.name},    {"type", "can"},
            {"bit_rate", bus.bit_rate()},     {"load_percent", bus.load_percent(line.now())},
            {"cut", bus.is_bus_cut()},        {"frames", counters.frames},
            {"errors", counters.errors},      {"collisions", counters.collisions},
            {"dropped", counters.dropped},    {"delayed", counters.delayed},
            {"corrupted", counters.corrupted}};
  view["disturbance"] = bus.disturbance() ? view_of_disturbance(*bus.disturbance()) : Json(nullptr);
  view["axes"] = Json::object();
  for (const auto& axis : line.axes()) {
    if (axis->settings().bus == index_of(line, named)) {
      view["axes"][axis->settings().name] = view_of_port(bus, axis->port());
    }
  }
  view["links"] = view_of_links(named.links);
  return view;
}

void calm(const Line& line, NamedBus& named) {
  named.bus.clear_disturbance();
  named.bus.cut_bus(false);
  for (const auto& axis : line.axes()) {
    if (axis->settings().bus == index_of(line, named)) named.bus.cut(axis->port(), false);
  }
}

void disturb(const Line& line, const Call& call, NamedBus& named) {
  constexpr double longest_delay_ms = 60'000;
  BodyReader body(call.body);
  links::Disturbance disturbance;
  disturbance.drop = body.number("drop", 0, 1).value_or(0);
  disturbance.delay = body.number("delay", 0, 1).value_or(0);
  disturbance.corrupt = body.number("corrupt", 0, 1).value_or(0);
  const double delay_ms = body.number("delay_ms", 0, longest_delay_ms).value_or(1);
  disturbance.delay_time = Time(static_cast<std::int64_t>(delay_ms * 1e6));
  disturbance.seed = body.integer("seed", UINT64_MAX).value_or(1);
  disturbance.id = static_cast<std::uint32_t>(body.integer("id", 0x1FFFFFFF).value_or(0));
  const std::uint64_t whole_id = body.has("id") ? 0x1FFFFFFF : 0;
  disturbance.id_mask = static_cast<std::uint32_t>(body.integer("id_mask", 0x1FFFFFFF).value_or(whole_id));
  disturbance.limit = static_cast<std::uint32_t>(body.integer("limit", UINT32_MAX).value_or(0));
  const bool cut = body.boolean("cut").value_or(false);
  const Axis* axis = named_axis(line, named, body);
  body.finish();

  calm(line, named);
  if (axis != nullptr) disturbance.port = static_cast<std::uint16_t>(axis->port());
  if (cut && axis != nullptr) named.bus.cut(axis->port(), true);
  if (cut && axis == nullptr) named.bus.cut_bus(true);
  if (disturbance.drop > 0 || disturbance.delay > 0 || disturbance.corrupt > 0) named.bus.disturb(disturbance);
}

}  // namespace servodrome::line::bench
