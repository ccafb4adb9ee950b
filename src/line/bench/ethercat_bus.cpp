#include <fmt/format.h>

#include "ethercat/slave/slave.hpp"
#include "line/bench/buses.hpp"

namespace servodrome::line::bench {
namespace {

constexpr double longest_delay_ms = 60'000;

Json view_of_disturbance(const links::EthercatDisturbance& disturbance) {
  return Json{{"drop", disturbance.drop},
              {"drop_answer", disturbance.drop_answer},
              {"corrupt", disturbance.corrupt},
              {"delay", disturbance.delay},
              {"delay_ms", std::chrono::duration<double, std::milli>(disturbance.delay_time).count()},
              {"position", disturbance.position ? Json(*disturbance.position + 1) : Json(nullptr)},
              {"seed", disturbance.seed},
              {"limit", disturbance.limit}};
}

// Converts the slave's position under `key`, from 1, to an index, from 0.
std::optional<std::size_t> place(BodyReader& body, const char* key, const NamedEthercatBus& named) {
  const auto position = body.integer(key, named.bus.size());
  if (!position) return std::nullopt;
  if (*position == 0) {
    throw ApiError{422, "there is no slave 0", key, fmt::format("write a position, 1 to {}", named.bus.size())};
  }
  return *position - 1;
}

}  // namespace

Json view_of(const Line& line, const NamedEthercatBus& named) {
  const links::EthercatBus& bus = named.bus;
  const links::EthercatCounters& counters = bus.counters();
  Json view{{"name", named.settings.name},     {"type", "ethercat"},
            {"frames", counters.frames},       {"lost", counters.lost},
            {"malformed", counters.malformed}, {"foreign", counters.foreign},
            {"dropped", counters.dropped},     {"delayed", counters.delayed},
            {"corrupted", counters.corrupted}};
  view["disturbance"] = bus.disturbance() ? view_of_disturbance(*bus.disturbance()) : Json(nullptr);
  view["unplugged"] = Json::array();
  for (std::size_t slave = 0; slave < bus.size(); ++slave) {
    if (!bus.cable(slave)) view["unplugged"].push_back(slave + 1);
  }
  view["ring"] = bus.cable(bus.size());
  view["axes"] = Json::object();
  for (const auto& axis : line.axes()) {
    const auto& settings = axis->settings().ethercat;
    if (!settings || line.ethercat_buses()[settings->bus].get() != &named) continue;
    if (!axis->powered()) {
      view["axes"][axis->settings().name] = Json{{"position", axis->position()}, {"powered", false}};
      continue;
    }
    const ethercat::Slave& slave = *axis->device().ethercat_slave();
    view["axes"][axis->settings().name] = Json{{"position", axis->position()},
                                               {"powered", true},
                                               {"state", ethercat::text(slave.state())},
                                               {"error", slave.error()},
                                               {"status_code", static_cast<unsigned>(slave.status_code())}};
  }
  view["links"] = view_of_links(named.links);
  return view;
}

void disturb(const Line& line, const Call& call, NamedEthercatBus& named) {
  BodyReader body(call.body);
  links::EthercatDisturbance disturbance;
  disturbance.drop = body.number("drop", 0, 1).value_or(0);
  disturbance.drop_answer = body.number("drop_answer", 0, 1).value_or(0);
  disturbance.corrupt = body.number("corrupt", 0, 1).value_or(0);
  disturbance.delay = body.number("delay", 0, 1).value_or(0);
  const double delay_ms = body.number("delay_ms", 0, longest_delay_ms).value_or(1);
  disturbance.delay_time = Time(static_cast<std::int64_t>(delay_ms * 1e6));
  disturbance.seed = body.integer("seed", UINT64_MAX).value_or(1);
  disturbance.limit = static_cast<std::uint32_t>(body.integer("limit", UINT32_MAX).value_or(0));
  disturbance.position = place(body, "position", named);
  const auto unplugged = place(body, "unplug", named);
  const bool ring = body.boolean("ring").value_or(named.bus.cable(named.bus.size()));
  body.finish();

  calm(line, named);
  if (unplugged) named.bus.set_cable(*unplugged, false);  // the cable in front of the slave
  named.bus.set_cable(named.bus.size(), ring);
  const double any = disturbance.drop + disturbance.drop_answer + disturbance.corrupt + disturbance.delay;
  if (any > 0) named.bus.disturb(disturbance);
}

void calm(const Line&, NamedEthercatBus& named) {
  named.bus.clear_disturbance();
  for (std::size_t cable = 0; cable < named.bus.size(); ++cable) named.bus.set_cable(cable, true);
}

}  // namespace servodrome::line::bench
