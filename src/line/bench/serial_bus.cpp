#include "line/bench/buses.hpp"
#include "links/serial/format_text.hpp"

namespace servodrome::line::bench {

Json view_of(const Line& line, const NamedSerialBus& named) {
  const links::SerialLine& serial = named.line;
  const links::SerialLineCounters& counters = serial.counters();
  const links::SerialDisturbance& disturbance = serial.disturbance();
  Json view{{"name", named.settings.name},
            {"type", "rs485"},
            {"bit_rate", serial.format().bit_rate},
            {"format", links::to_string(serial.format())},
            {"cut", disturbance.cut},
            {"characters", counters.characters},
            {"collisions", counters.collisions},
            {"disturbed", counters.disturbed}};
  const bool is_disturbed = disturbance.drop > 0 || disturbance.corrupt > 0;
  view["disturbance"] =
      is_disturbed ? Json{{"drop", disturbance.drop}, {"corrupt", disturbance.corrupt}, {"seed", disturbance.seed}}
                   : Json(nullptr);
  view["axes"] = Json::object();
  for (const auto& axis : line.axes()) {
    const auto& settings = axis->settings().serial;
    if (!settings || line.serial_buses()[settings->bus].get() != &named) continue;
    const products::SerialPort& port = *axis->device().serial_port();
    view["axes"][axis->settings().name] = Json{{"station", port.station()},
                                               {"protocol", name_of(port.protocol())},
                                               {"bit_rate", port.format().bit_rate},
                                               {"format", links::to_string(port.format())}};
  }
  view["links"] = view_of_links(named.links);
  return view;
}

void disturb(const Line&, const Call& call, NamedSerialBus& named) {
  BodyReader body(call.body);
  links::SerialDisturbance disturbance;
  disturbance.drop = body.number("drop", 0, 1).value_or(0);
  disturbance.corrupt = body.number("corrupt", 0, 1).value_or(0);
  disturbance.seed = body.integer("seed", UINT64_MAX).value_or(1);
  disturbance.cut = body.boolean("cut").value_or(false);
  body.finish();
  named.line.disturb(disturbance);
}

void calm(const Line&, NamedSerialBus& named) { named.line.disturb({}); }

}  // namespace servodrome::line::bench
