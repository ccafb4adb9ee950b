// The effect of an action when its rule begins, and how it is undone when the rule ends.

#include <fmt/format.h>

#include "canopen/connection_set.hpp"
#include "describe/words.hpp"
#include "ethercat/slave/slave.hpp"
#include "scenario/bench_call.hpp"
#include "scenario/director.hpp"

namespace servodrome::scenario {
namespace {

// The kinds of messages by the bus on which they occur.
bool is_of_can(MessageKind kind) { return kind <= MessageKind::to_drive; }
bool is_of_serial(MessageKind kind) { return kind == MessageKind::answer || kind == MessageKind::request; }

bool needs_slave(const Action& action) {
  return std::holds_alternative<RefuseState>(action) || std::holds_alternative<DropState>(action) ||
         std::holds_alternative<PatchSii>(action) || std::holds_alternative<DisturbClock>(action) ||
         std::holds_alternative<DisturbSync0>(action) || std::holds_alternative<StaleInputs>(action) ||
         std::holds_alternative<WatchdogOff>(action);
}

bool needs_axis(const Action& action) {
  return object_of(action) != nullptr || needs_slave(action) || std::holds_alternative<Request>(action) ||
         std::holds_alternative<Switch>(action) || std::holds_alternative<Emergency>(action) ||
         std::holds_alternative<ForceErrorState>(action);
}

// Returns why the number of the action cannot be the value, or bits of the value, of the object; "": it can.
std::string misfit(const Action& action, const dictionary::Entry& entry) {
  using How = Show::How;
  std::int64_t number = 0;
  bool is_bits = false;
  if (const auto* set = std::get_if<SetObject>(&action)) {
    number = set->value;
  } else if (const auto* show = std::get_if<Show>(&action); show != nullptr) {
    is_bits = show->how == How::set_bits || show->how == How::clear_bits || show->how == How::flip_bits;
    if (show->how != How::value && !is_bits) return {};
    number = show->number;
  } else {
    return {};
  }
  const std::string object = fmt::format("{:04X}h:{:02X}", entry.index, entry.sub);
  if (!entry.fixed_size() || entry.type == dictionary::Type::real32) {
    return fmt::format("{} is not a whole number", object);
  }
  const std::int64_t lowest = dictionary::minimum_of(entry.type);
  std::int64_t highest = dictionary::maximum_of(entry.type);
  if (is_bits && dictionary::size_of(entry.type) < sizeof number) highest -= lowest;  // the sign is a bit
  if (number >= lowest && number <= highest) return {};
  return fmt::format("{} does not fit into {}, {}, {} .. {}", number, object, describe::word(entry.type), lowest,
                     highest);
}

}  // namespace

links::CanBus* Director::can_bus(const RuleRun& rule) const {
  if (rule.axis != nullptr) {
    const auto& bus = rule.axis->settings().bus;
    return bus ? &line_.buses()[*bus]->bus : nullptr;
  }
  line::NamedBus* bus = line_.find_bus(rule.rule->bus);
  return bus != nullptr ? &bus->bus : nullptr;
}

line::NamedSerialBus* Director::serial_bus(const RuleRun& rule) const {
  if (rule.axis == nullptr) return line_.find_serial_bus(rule.rule->bus);
  const auto& serial = rule.axis->settings().serial;
  return serial ? line_.serial_buses()[serial->bus].get() : nullptr;
}

// Keys that apply only to some messages of serial lines.
void Director::check_serial(const Rule& rule) {
  const bool of_answers = std::holds_alternative<Slow>(rule.action) || std::holds_alternative<Close>(rule.action);
  if (of_answers && rule.on && rule.on->kind != MessageKind::answer) {
    throw ScenarioError("the action is for answers on serial lines", rule.name, "write on = { message = \"answer\" }");
  }
  if (!rule.on || rule.on->kind != MessageKind::request) return;
  if (std::holds_alternative<Delay>(rule.action) || std::holds_alternative<Repeat>(rule.action)) {
    throw ScenarioError("a serial request is neither delayed nor repeated", rule.name, "act on its answer");
  }
  if (rule.checksum) {
    throw ScenarioError("a serial request that is changed has a wrong checksum", rule.name, "leave `checksum` out");
  }
}

void Director::check(const RuleRun& run) const {
  const Rule& rule = *run.rule;
  const auto refuse = [&rule](const std::string& what, const std::string& hint) {
    throw ScenarioError(what, rule.name, hint);
  };
  if (const ObjectAddress* object = object_of(rule.action); object != nullptr && run.axis != nullptr) {
    const dictionary::Dictionary& objects = run.axis->device().bus_dictionary();
    const dictionary::Entry* found = objects.find(object->index, object->sub.value_or(0));
    if (found == nullptr) {
      refuse(fmt::format("the drive has no object {:04X}h:{:02X}", object->index, object->sub.value_or(0)),
             "`servodrome export` writes a list of its objects");
    }
    // Sub-index 0 of an array or record is the number of its elements.
    const bool has_elements =
        found->code == dictionary::ObjectCode::array || found->code == dictionary::ObjectCode::record;
    if (std::holds_alternative<SetObject>(rule.action) && !object->sub && has_elements) {
      refuse(fmt::format("{:04X}h has several sub-indices, and `set` writes one", object->index),
             fmt::format("name it: object = \"{:04X}:01\"", object->index));
    }
    for (const dictionary::Entry& entry : objects.table()) {
      if (!object->contains(entry.index, entry.sub)) continue;
      if (const std::string why = misfit(rule.action, entry); !why.empty()) {
        refuse(why, "give a number of the object's type, or name the sub-index: object = \"1018:01\"");
      }
    }
  }
  check_serial(rule);
  const auto* frames = std::get_if<Send>(&rule.action);
  if (frames != nullptr && frames->data.size() > 8 && can_bus(run) != nullptr) {
    refuse("the data are longer than 8 bytes", "a CAN frame has at most 8");
  }
  if (frames != nullptr && frames->data.empty() && can_bus(run) == nullptr && serial_bus(run) != nullptr) {
    refuse("the action sends no characters", "give them as `data` of `send`: data = \"55\"");
  }
  if (run.axis == nullptr) {
    const bool known = line_.find_bus(rule.bus) != nullptr || line_.find_ethercat_bus(rule.bus) != nullptr ||
                       line_.find_serial_bus(rule.bus) != nullptr;
    if (!known) refuse(fmt::format("there is no bus \"{}\"", rule.bus), "name a bus of the line");
    if (needs_axis(rule.action)) {
      refuse("the action needs an axis", "write axis = \"NAME\" in place of `bus`");
    }
    return;
  }
  check_names(run);
  const auto& settings = run.axis->settings();
  if (needs_slave(rule.action) && !settings.ethercat) {
    refuse("the axis is not on an EtherCAT segment", "choose an axis that is");
  }
  // A rule about the passage of a frame through one slave can have only the actions below.
  const bool is_frame = rule.on && is_of_segment(rule.on->kind);
  const bool is_passage = std::holds_alternative<Withhold>(rule.action) ||
                          std::holds_alternative<WorkingCounter>(rule.action) || makes_messages(rule.action);
  if (is_frame && !rule.axis.empty() && !is_passage) {
    refuse("the action is about the whole frame", "leave out `axis`, or name the bus");
  }
  const bool needs_can = std::holds_alternative<ForceErrorState>(rule.action) ||
                         (rule.on && is_of_can(rule.on->kind) && !settings.ethercat);
  if (needs_can && !settings.bus) refuse("the axis is not on a CAN bus", "choose an axis that is");
  if (rule.on && is_of_serial(rule.on->kind) && !settings.serial) {
    refuse("the axis is not on an RS485 line", "choose an axis that is");
  }
}

// Sends the frame on the rule's CAN bus, or the characters on its RS485 line. Returns false if it has neither. While
// frames of the rule wait for the bus, it sends no further one: the bus is slower than the rule's period.
bool Director::speak(RuleRun& rule, const Send& send) {
  constexpr std::size_t most_waiting = 2;  // one on the wire, and one that follows it without a gap
  links::CanBus* bus = can_bus(rule);
  line::NamedSerialBus* serial = serial_bus(rule);
  if (serial != nullptr && (bus == nullptr || (rule.rule->on && is_of_serial(rule.rule->on->kind)))) {
    stations_.at(serial)->send(send.data, now());
    act(rule);
    return true;
  }
  if (bus == nullptr) return false;
  canopen::Frame frame;
  frame.id = send.id;
  frame.extended = send.id > 0x7FF;
  frame.length = static_cast<std::uint8_t>(send.data.size());
  std::copy(send.data.begin(), send.data.end(), frame.data.begin());
  RulePort& port = *ports_.at(bus);
  if (rule.rule->on || port.waiting(rule) < most_waiting) {
    port.send(frame, now(), &rule);
    act(rule);
  }
  return true;
}

void Director::send(RuleRun& rule) {
  const auto& send = std::get<Send>(rule.rule->action);
  if (rule.phase != RuleRun::Phase::active || !speak(rule, send)) return;
  if (!rule.rule->on && !rule.exhausted()) {
    const line::NamedSerialBus* serial = can_bus(rule) == nullptr ? serial_bus(rule) : nullptr;
    const Time lasts = serial != nullptr ? serial->line.format().character_time() * std::ssize(send.data) : Time{};
    repeat(rule, now() + std::max(send.period, lasts), &Director::send);
  }
}

void Director::do_deed(RuleRun& rule) {
  const Action& action = rule.rule->action;
  if (acts_on_messages(action)) return;
  if (acts_when_asked(action)) return;
  if (!makes_messages(action)) act(rule);
  if (const auto* wanted = std::get_if<Request>(&action)) {
    rule.error = call_bench(line_, *rule.axis, wanted->method, wanted->path, wanted->body).error;
  } else if (std::holds_alternative<Send>(action)) {
    send(rule);
  } else if (const auto* accept = std::get_if<Accept>(&action)) {
    if (!accept->on) end_connections(rule);
  } else if (const auto* set = std::get_if<SetObject>(&action)) {
    write_own(*rule.axis, *set);
  } else if (const auto* drop = std::get_if<DropState>(&action)) {
    drop_state(*rule.axis, *drop);
  } else if (const auto* sii = std::get_if<PatchSii>(&action)) {
    patch(*rule.axis, *sii);
  } else if (std::holds_alternative<Emergency>(action)) {
    raise(rule);
  } else {
    const auto* clock = std::get_if<DisturbClock>(&action);
    if (clock != nullptr && clock->jump_ns != 0) {
      rule.axis->device().ethercat_controller()->jump_clock(Time(clock->jump_ns), now());
    }
    for (MachineState& state : held_by(rule)) rule.error = held_states_.hold(rule, std::move(state));
  }
}

// Frames of the rule that still wait are not sent, unless they complete its number of acts.
void Director::undo_deed(RuleRun& rule) {
  held_states_.release(rule);
  if (std::holds_alternative<Send>(rule.rule->action) && can_bus(rule) != nullptr) {
    ports_.at(can_bus(rule))->leave(rule, rule.exhausted());
  }
}

void Director::end_connections(const RuleRun& rule) {
  line::NamedSerialBus* bus = serial_bus(rule);
  for (std::size_t i = 0; bus != nullptr && i < bus->links.size(); ++i) bus->links[i]->end_connections();
}

void Director::write_own(line::Axis& axis, const SetObject& set) {
  dictionary::Dictionary& objects = axis.device().dictionary();
  const dictionary::Entry* entry = objects.find(set.object.index, set.object.sub.value_or(0));
  if (!axis.powered() || entry == nullptr) return;
  const auto bytes = dictionary::encode_number(set.value);
  objects.write_any(*entry, std::span(bytes).first(dictionary::size_of(entry->type)));
  axis.send_waiting(now());
}

void Director::drop_state(line::Axis& axis, const DropState& drop) {
  if (!axis.powered()) return;
  axis.device().ethercat_slave()->fall_back(drop.to, static_cast<ethercat::AlStatusCode>(drop.code), now());
}

void Director::patch(line::Axis& axis, const PatchSii& patch) {
  constexpr std::size_t checksum_word = 7;
  const std::span<std::uint8_t> memory = axis.device().ethercat_controller()->sii().memory();
  const std::size_t place = std::size_t{patch.word} * 2;
  if (place + 2 > memory.size()) return;
  memory[place] = static_cast<std::uint8_t>(patch.value);
  memory[place + 1] = static_cast<std::uint8_t>(patch.value >> 8);
  if (patch.word > checksum_word) return;
  if (patch.word < checksum_word) {
    memory[2 * checksum_word] = ethercat::sii_checksum(memory.first(2 * checksum_word));
  }
  axis.device().ethercat_controller()->load_sii_anew();
}

// Sends an EMCY as if the drive sent it, without a fault (CiA 301 7.2.7.3.1, ETG.1000.6 clause 5.6.4).
void Director::raise(RuleRun& rule) {
  const auto& emergency = std::get<Emergency>(rule.rule->action);
  if (rule.phase != RuleRun::Phase::active) return;
  act(rule);
  if (!rule.rule->on && !rule.exhausted()) {
    repeat(rule, now() + emergency.period, &Director::raise);
  }
  line::Axis& axis = *rule.axis;
  if (!axis.powered()) return;
  if (ethercat::Slave* slave = axis.device().ethercat_slave()) {
    // If the rule acts on a message, the slave sends the emergency before its own answer.
    const bool posted = rule.rule->on && slave->post(coe_emergency(emergency.code, emergency.error_register));
    if (!posted) slave->emergency(emergency.code, emergency.error_register, {});
    return;
  }
  canopen::Frame frame;
  frame.id = canopen::connection_set::emergency + axis.device().node_id();
  frame.length = 8;
  frame.data = {static_cast<std::uint8_t>(emergency.code), static_cast<std::uint8_t>(emergency.code >> 8),
                emergency.error_register};
  if (parts(axis).can) parts(axis).can->speak(frame, now());
}

std::vector<std::string> Director::try_requests() {
  std::vector<std::string> errors;
  for (const auto& rule : rules_) {
    const auto* wanted = std::get_if<Request>(&rule->rule->action);
    if (wanted == nullptr) continue;
    const std::string error = call_bench(line_, *rule->axis, wanted->method, wanted->path, wanted->body).error;
    if (!error.empty()) errors.push_back(fmt::format("{}: {}", rule->rule->name, error));
  }
  return errors;
}

std::vector<std::string> rehearse(line::LineSettings settings, const Scenario& scenario) {
  for (line::AxisSettings& axis : settings.axes) axis.store.clear();
  line::Line line(settings);
  try {
    Director director(line, scenario);
    director.begin();
    return director.try_requests();
  } catch (const ScenarioError& error) {
    return {fmt::format("{}: {}; {}", error.where(), error.what(), error.hint())};
  }
}

}  // namespace servodrome::scenario
