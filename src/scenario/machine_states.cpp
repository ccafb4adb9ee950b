// The states of the machine that rules hold while they act: how each is read and written.

#include <algorithm>
#include <fmt/format.h>

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

// The name under which the API lists an injected fault. It lists a fault of the drive by its code, but a rule may name
// the cause of the fault.
std::string listed_name(const json& faults, const std::string& name) {
  for (const json& one : faults["injectable"]["drive"]) {
    if (one["cause"] == name) return one["code"];
  }
  return name;
}

MachineState fault_of(line::Line& line, line::Axis& axis, const std::string& name) {
  const auto is_injected = [&line, &axis, name]() -> MachineState::Value {
    const json faults = call_bench(line, axis, "GET", "/faults").body;
    const json& injected = faults["injected"];
    return std::find(injected.begin(), injected.end(), listed_name(faults, name)) != injected.end();
  };
  return {.name = fmt::format("fault {} of {}", name, axis.settings().name),
          .read = is_injected,
          .write = [&line, &axis, name](MachineState::Value on) {
            return call_bench(line, axis, *on ? "POST" : "DELETE", "/faults", json{{"inject", name}}.dump()).error;
          }};
}

MachineState input_of(line::Line& line, line::Axis& axis, const std::string& wire) {
  return {.name = fmt::format("input {} of {}", wire, axis.settings().name),
          .read = [&line, &axis, wire]() -> MachineState::Value {
            const json answer = call_bench(line, axis, "GET", "/inputs").body;
            const json& input = answer["inputs"].value(wire, json::object());
            return input.value("forced", false) ? std::optional(input.value("level", false)) : std::nullopt;
          },
          .write =
              [&line, &axis, wire](MachineState::Value level) {
                const json value = level ? json(*level) : json(nullptr);
                return call_bench(line, axis, "PUT", "/inputs", json{{wire, value}}.dump()).error;
              }};
}

MachineState locked_rotor_of(line::Line& line, line::Axis& axis) {
  return {.name = "rotor of " + axis.settings().name,
          .read = [&axis] { return axis.plant().rotor_locked(); },
          .write =
              [&line, &axis](MachineState::Value locked) {
                return call_bench(line, axis, "PUT", "/plant", json{{"locked_rotor", *locked}}.dump()).error;
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
                esc->set_watchdog_dead(*dead);
                return std::string();
              }};
}

bool is_cut(const links::SerialLine& line) { return line.disturbance().cut; }
void cut(links::SerialLine& line, bool is_cut) {
  links::SerialDisturbance disturbance = line.disturbance();
  disturbance.cut = is_cut;
  line.disturb(disturbance);
}

// The value of a cable is true if it is connected.
MachineState cable_of_bus(line::Line& line, const std::string& name) {
  line::NamedBus* can = line.find_bus(name);
  line::NamedEthercatBus* ethercat = line.find_ethercat_bus(name);
  line::NamedSerialBus* serial = line.find_serial_bus(name);
  return {.name = "cable of the bus " + name,
          .read = [can, ethercat, serial]() -> MachineState::Value {
            if (can != nullptr) return !can->bus.is_bus_cut();
            if (ethercat != nullptr) return ethercat->bus.cable(0);
            return serial == nullptr || !is_cut(serial->line);
          },
          .write =
              [can, ethercat, serial](MachineState::Value connected) {
                if (can != nullptr) can->bus.cut_bus(!*connected);
                if (ethercat != nullptr) ethercat->bus.set_cable(0, *connected);
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
  links::CanBus* can = settings.bus ? &line_.buses()[*settings.bus]->bus : nullptr;
  links::EthercatBus* ethercat = settings.ethercat ? &line_.ethercat_buses()[settings.ethercat->bus]->bus : nullptr;
  SerialStage* serial = parts(axis).serial.get();
  return {.name = "cable of " + settings.name,
          .read = [can, ethercat, serial, &axis]() -> MachineState::Value {
            if (can != nullptr) return !can->is_cut(axis.port());
            if (ethercat != nullptr) return ethercat->cable(axis.position() - 1);
            return serial == nullptr || !serial->is_cut();
          },
          .write =
              [can, ethercat, serial, &axis](MachineState::Value connected) {
                if (can != nullptr) can->cut(axis.port(), !*connected);
                if (ethercat != nullptr) ethercat->set_cable(axis.position() - 1, *connected);
                if (serial != nullptr) serial->cut(!*connected);
                return std::string();
              }};
}

MachineState Director::held_by(const RuleRun& rule) {
  const Action& action = rule.rule->action;
  if (std::holds_alternative<WatchdogOff>(action)) return watchdog_of(*rule.axis);
  MachineState state;
  if (const auto* cable = std::get_if<Cable>(&action)) {
    state = rule.axis != nullptr ? cable_of(*rule.axis) : cable_of_bus(line_, rule.rule->bus);
    state.held = cable->connected;
  } else if (const auto* wanted = std::get_if<Switch>(&action)) {
    state = state_of(line_, *rule.axis, *wanted);
    state.held = wanted->on;
  }
  return state;
}

}  // namespace servodrome::scenario
