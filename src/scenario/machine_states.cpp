// The states of the machine that rules hold while they act: how each is read and written.

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <memory>

#include "drive/drive.hpp"
#include "links/nearest_name.hpp"
#include "scenario/bench_call.hpp"
#include "scenario/director.hpp"

namespace servodrome::scenario {
namespace {

using nlohmann::json;

MachineState power_of(line::Line& line, line::Axis& axis) {
  return {.name = "power of " + axis.settings().name,
          .read = [&axis] { return axis.powered(); },
          .write =
              [&line, &axis](MachineState::Value on) {
                return call_bench(line, axis, "POST", "/power", json{{"action", *on ? "on" : "off"}}.dump()).error;
              }};
}

// The cause of a fault of the drive that has this name or this code; none: there is no such fault. Of several causes
// with this code it is the first in the order of drive::Cause, as for the faults of the bench.
drive::Cause cause_of(line::Axis& axis, const std::string& name) {
  for (unsigned number = 1; number <= UINT8_MAX; ++number) {
    const auto cause = static_cast<drive::Cause>(number);
    const drive::FaultRow* row = axis.device().drive().row(cause);
    if (row != nullptr && (name == drive::name(cause) || name == fmt::format("0x{:04X}", row->code))) return cause;
  }
  return drive::Cause::none;
}

// A rule may name a fault of the drive by its code; the state has the name of the cause, because several causes may
// have the same code. A cause in the plant comes before a cause of the drive with the same name.
MachineState fault_of(line::Line& line, line::Axis& axis, const std::string& name) {
  const auto injection = plant::injection_from_name(name);
  const drive::Cause cause = injection ? drive::Cause::none : cause_of(axis, name);
  return {.name = injection ? fmt::format("fault {} in the plant of {}", name, axis.settings().name)
                            : fmt::format("fault {} of {}", drive::name(cause), axis.settings().name),
          .read = [&axis, injection, cause]() -> MachineState::Value {
            return injection ? axis.plant().injected(*injection) : axis.injected(cause);
          },
          .write =
              [&line, &axis, injection, cause](MachineState::Value on) {
                if (injection) {
                  axis.plant().inject(*injection, *on != 0);
                } else {
                  axis.inject(cause, *on != 0);
                }
                line.changed();
                return std::string();
              }};
}

MachineState input_of(line::Line& line, line::Axis& axis, const std::string& wire) {
  return {.name = fmt::format("input {} of {}", wire, axis.settings().name),
          .read = [&line, &axis, wire]() -> MachineState::Value {
            const json answer = call_bench(line, axis, "GET", "/inputs").body;
            const json& input = answer["inputs"].value(wire, json::object());
            return input.value("forced", false) ? MachineState::Value(input.value("level", false)) : std::nullopt;
          },
          .write =
              [&line, &axis, wire](MachineState::Value level) {
                const json value = level ? json(*level != 0) : json(nullptr);
                return call_bench(line, axis, "PUT", "/inputs", json{{wire, value}}.dump()).error;
              }};
}

MachineState locked_rotor_of(line::Line& line, line::Axis& axis) {
  return {.name = "rotor of " + axis.settings().name,
          .read = [&axis] { return axis.plant().rotor_locked(); },
          .write =
              [&line, &axis](MachineState::Value locked) {
                return call_bench(line, axis, "PUT", "/plant", json{{"locked_rotor", *locked != 0}}.dump()).error;
              }};
}

MachineState state_of(line::Line& line, line::Axis& axis, const Switch& action) {
  switch (action.what) {
    case Switch::What::power: return power_of(line, axis);
    case Switch::What::fault: return fault_of(line, axis, action.name);
    case Switch::What::input: return input_of(line, axis, action.name);
    case Switch::What::locked_rotor: return locked_rotor_of(line, axis);
  }
  return {};
}

MachineState watchdog_of(line::Axis& axis) {
  ethercat::Esc* esc = axis.device().ethercat_controller();
  return {.name = "watchdog of " + axis.settings().name,
          .held = true,
          .read = [esc] { return esc->watchdog_dead(); },
          .write =
              [esc](MachineState::Value dead) {
                esc->set_watchdog_dead(*dead != 0);
                return std::string();
              }};
}

// The state of a clock. Only rules change it, so the state stores the present value itself. All rules on a clock share
// the state of the first one.
MachineState clock_state(std::string name, std::int64_t usual, std::int64_t held,
                         std::function<void(std::int64_t)> set) {
  const auto present = std::make_shared<std::int64_t>(usual);
  return {.name = std::move(name),
          .held = held,
          .read = [present]() -> MachineState::Value { return *present; },
          .write =
              [present, set = std::move(set)](MachineState::Value value) {
                *present = *value;
                set(*value);
                return std::string();
              }};
}

std::vector<MachineState> clock_of(const line::Line& line, line::Axis& axis, const DisturbClock& clock) {
  ethercat::Esc* esc = axis.device().ethercat_controller();
  const auto ppb = [](double ppm) { return std::llround(ppm * 1000); };
  std::vector<MachineState> states;
  if (clock.stop) {
    states.push_back(clock_state("stop of the clock of " + axis.settings().name, 0, 1,
                                 [&line, esc](std::int64_t stops) { esc->stop_clock(stops != 0, line.now()); }));
  }
  if (clock.ppm) {
    states.push_back(clock_state(
        "oscillator of " + axis.settings().name, ppb(axis.settings().ethercat->oscillator_ppm), ppb(*clock.ppm),
        [&line, esc](std::int64_t error) { esc->set_oscillator(static_cast<std::int32_t>(error), line.now()); }));
  }
  return states;
}

MachineState error_state_of(const line::Line& line, links::CanBus& bus, const line::Axis& axis,
                            links::ErrorState state) {
  return {.name = "error state of " + axis.settings().name,
          .held = static_cast<std::int64_t>(state),
          .read = [&bus, port = axis.port()]() -> MachineState::Value {
            return static_cast<std::int64_t>(bus.forced_error_state(port));
          },
          .write =
              [&line, &bus, port = axis.port()](MachineState::Value value) {
                bus.force_error_state(port, static_cast<links::ErrorState>(*value), line.now());
                return std::string();
              }};
}

// The cable in front of a slave, number 0 that of the master. The value of a cable is true if it is connected.
MachineState segment_cable(line::NamedEthercatBus& segment, std::size_t number) {
  return {.name = fmt::format("cable {} of the segment {}", number, segment.settings.name),
          .read = [&segment, number]() -> MachineState::Value { return segment.bus.cable(number); },
          .write =
              [&segment, number](MachineState::Value connected) {
                segment.bus.set_cable(number, *connected != 0);
                return std::string();
              }};
}

bool is_cut(const links::SerialLine& line) { return line.disturbance().cut; }
void cut(links::SerialLine& line, bool is_cut) {
  links::SerialDisturbance disturbance = line.disturbance();
  disturbance.cut = is_cut;
  line.disturb(disturbance);
}

MachineState cable_of_bus(line::Line& line, const std::string& name) {
  line::NamedBus* can = line.find_bus(name);
  if (line::NamedEthercatBus* segment = line.find_ethercat_bus(name)) return segment_cable(*segment, 0);
  line::NamedSerialBus* serial = line.find_serial_bus(name);
  return {.name = "cable of the bus " + name,
          .read = [can, serial]() -> MachineState::Value {
            if (can != nullptr) return !can->bus.is_bus_cut();
            return serial == nullptr || !is_cut(serial->line);
          },
          .write =
              [can, serial](MachineState::Value connected) {
                if (can != nullptr) can->bus.cut_bus(!*connected);
                if (serial != nullptr) cut(serial->line, !*connected);
                return std::string();
              }};
}

}  // namespace

void Director::check_names(const RuleRun& rule) const {
  const std::string& axis = rule.axis->settings().name;
  const auto refuse = [&](const std::string& what, const json& names, const std::string& name) {
    std::vector<std::string> words = names.get<std::vector<std::string>>();
    throw ScenarioError(fmt::format("the axis \"{}\" has no {} \"{}\"", axis, what, name), rule.rule->name,
                        links::suggestion(name, {words.begin(), words.end()}));
  };
  const auto keys_of = [](const json& object) {
    json keys = json::array();
    for (const auto& [key, value] : object.items()) keys.push_back(key);
    return keys;
  };
  if (const auto* request = std::get_if<Request>(&rule.rule->action); request != nullptr && request->path == "/plant") {
    const json present = call_bench(line_, *rule.axis, "GET", "/plant").body;
    const json wanted = json::parse(request->body);
    for (const auto& [key, value] : wanted.items()) {
      if (!present.contains(key)) refuse("quantity", keys_of(present), key);
    }
  }
  const auto* wanted = std::get_if<Switch>(&rule.rule->action);
  if (wanted != nullptr && wanted->what == Switch::What::input) {
    const json answer = call_bench(line_, *rule.axis, "GET", "/inputs").body;
    if (!answer["inputs"].contains(wanted->name)) refuse("input", keys_of(answer["inputs"]), wanted->name);
  }
  if (wanted != nullptr && wanted->what == Switch::What::fault) {
    const json injectable = call_bench(line_, *rule.axis, "GET", "/faults").body["injectable"];
    json names = injectable["plant"];
    for (const json& one : injectable["drive"]) {
      names.push_back(one["cause"]);
      names.push_back(one["code"]);
    }
    if (std::find(names.begin(), names.end(), wanted->name) == names.end()) refuse("fault", names, wanted->name);
  }
}

MachineState Director::cable_of(line::Axis& axis) {
  const auto& settings = axis.settings();
  if (settings.ethercat) return segment_cable(*line_.ethercat_buses()[settings.ethercat->bus], axis.position() - 1);
  links::CanBus* can = settings.bus ? &line_.buses()[*settings.bus]->bus : nullptr;
  SerialStage* serial = parts(axis).serial.get();
  return {.name = "cable of " + settings.name,
          .read = [can, serial, &axis]() -> MachineState::Value {
            if (can != nullptr) return !can->is_cut(axis.port());
            return serial == nullptr || !serial->is_cut();
          },
          .write =
              [can, serial, &axis](MachineState::Value connected) {
                if (can != nullptr) can->cut(axis.port(), !*connected);
                if (serial != nullptr) serial->cut(!*connected);
                return std::string();
              }};
}

std::vector<MachineState> Director::held_by(const RuleRun& rule) {
  const Action& action = rule.rule->action;
  if (std::holds_alternative<WatchdogOff>(action)) return {watchdog_of(*rule.axis)};
  if (const auto* clock = std::get_if<DisturbClock>(&action)) return clock_of(line_, *rule.axis, *clock);
  if (const auto* forced = std::get_if<ForceErrorState>(&action)) {
    return {error_state_of(line_, *can_bus(rule), *rule.axis, forced->state)};
  }
  MachineState state;
  if (const auto* cable = std::get_if<Cable>(&action)) {
    state = rule.axis != nullptr ? cable_of(*rule.axis) : cable_of_bus(line_, rule.rule->bus);
    state.held = cable->connected;
  } else if (const auto* wanted = std::get_if<Switch>(&action)) {
    state = state_of(line_, *rule.axis, *wanted);
    state.held = wanted->on;
  } else {
    return {};
  }
  return {std::move(state)};
}

}  // namespace servodrome::scenario
