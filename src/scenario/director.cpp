#include "scenario/director.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "ethercat/slave/slave.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::scenario {
namespace {

constexpr std::size_t most_rules_by_hand = 4096;

// Returns true if the rule ends after its number of acts. Other actions have one act with a lasting effect. An Ignore
// of single bits ends later: at the write that would be one act too many.
bool ends_with_its_acts(const Rule& rule) {
  const auto* ignore = std::get_if<Ignore>(&rule.action);
  if (ignore != nullptr && ignore->mask != -1) return false;
  return rule.on || makes_messages(rule.action) || acts_when_asked(rule.action);
}

}  // namespace

Director::Director(line::Line& line, Scenario scenario) : line_(line), scenario_(std::move(scenario)), master_(line) {
  facts_.master = &master_;
  for (const Rule& rule : scenario_.rules) set_up(rule);
  for (const Expectation& expectation : scenario_.expectations) set_up(expectation);
}

void Director::begin() {
  begun_ = true;
  place_stages();
  looks_at_ = now();
  reached(now());  // rules without a condition act from the first frame on, also on the boot-up of a new line
  for (const auto& axis : line_.axes()) axis->send_waiting(now());
  line_.add_follower(*this);
  line_.changed();
}

void Director::take_over(Director& former) {
  former.finish();
  ports_ = std::move(former.ports_);
  stations_ = std::move(former.stations_);
}

Director::~Director() {
  if (!begun_) return;
  finish();
  line_.remove_follower(*this);
  for (auto& [axis, parts] : parts_) {
    axis->interpose(nullptr);
    if (parts.slave) axis->device().ethercat_slave()->interpose(nullptr);
    axis->device().bus_dictionary().set_view(nullptr);
    axis->device().dictionary().set_view(nullptr);
  }
}

line::Axis* Director::axis_named(const std::string& name, const std::string& where) const {
  if (name.empty()) {
    if (line_.axes().size() == 1) return line_.axes().front().get();
    throw ScenarioError("the line has several axes", where, "name one: axis = \"NAME\"");
  }
  if (line::Axis* axis = line_.find_axis(name)) return axis;
  std::vector<std::string_view> names;
  for (const auto& axis : line_.axes()) names.emplace_back(axis->settings().name);
  throw ScenarioError(fmt::format("there is no axis \"{}\"", name), where, links::suggestion(name, names));
}

line::Axis* Director::axis_for(const std::string& name, const std::string& where, bool needed) const {
  if (name.empty() && !needed) return line_.axes().size() == 1 ? line_.axes().front().get() : nullptr;
  return axis_named(name, where);
}

// The object of a condition must be a whole number that the drive has, and `mask` and `value` must fit into it.
void Director::check_object(const Condition& condition, line::Axis* axis, const std::string& where) {
  if (!condition.object || axis == nullptr) return;
  const std::uint8_t sub = condition.object->sub.value_or(0);
  const std::string object = fmt::format("{:04X}h:{:02X}", condition.object->index, sub);
  const dictionary::Entry* entry = axis->device().dictionary().find(condition.object->index, sub);
  if (entry == nullptr) {
    throw ScenarioError(fmt::format("the drive has no object {}", object), where,
                        "`servodrome export` writes a list of its objects");
  }
  if (!entry->fixed_size() || entry->type == dictionary::Type::real32) {
    throw ScenarioError(fmt::format("{} is not a whole number", object), where, "name another object");
  }
  const std::int64_t lowest = dictionary::minimum_of(entry->type);
  std::int64_t highest = dictionary::maximum_of(entry->type);
  if (dictionary::size_of(entry->type) < sizeof highest) highest -= lowest;  // the sign is a bit
  const bool fits = condition.value >= lowest && condition.value <= highest;
  if (fits && (condition.mask == -1 || (condition.mask >= lowest && condition.mask <= highest))) return;
  throw ScenarioError(fmt::format("{} does not fit into {}, {} .. {}", fits ? condition.mask : condition.value, object,
                                  lowest, highest),
                      where, fits ? "correct `mask`" : "correct `value`");
}

std::unique_ptr<RuleRun> Director::run_of(const Rule& rule, std::size_t number) const {
  const bool about_bus = !rule.bus.empty();
  const bool needed = !about_bus || needs_axis(rule.when) || (rule.until && needs_axis(*rule.until));
  const bool named = !rule.when.axis.empty();
  line::Axis* axis = axis_for(named ? rule.when.axis : rule.axis, rule.name, needed);
  auto run =
      std::make_unique<RuleRun>(rule, about_bus ? nullptr : axis_for(rule.axis, rule.name, !named), axis, number);
  check(*run);
  check_object(rule.when, axis, rule.name);
  check_object(rule.until.value_or(Condition{}), axis, rule.name);
  return run;
}

void Director::set_up(const Rule& rule) {
  rules_.push_back(run_of(rule, next_number_++));
  facts_.first_acts[rule.name] = std::nullopt;
  rules_.back()->when.begin();
}

void Director::check(const std::vector<Rule>& rules) const {
  if (rules_.size() + rules.size() > most_rules_by_hand) {
    throw ScenarioError(fmt::format("the scenario would have more than {} rules", most_rules_by_hand), "rules",
                        "remove some");
  }
  for (const Rule& rule : rules) {
    const bool is_there = std::any_of(rules_.begin(), rules_.end(),
                                      [&rule](const auto& other) { return other->rule->name == rule.name; });
    if (is_there) throw ScenarioError("there is a rule of this name already", rule.name, "give it another `name`");
    run_of(rule, next_number_);
  }
}

void Director::add(const std::vector<Rule>& rules) {
  check(rules);
  for (const Rule& rule : rules) {
    added_.push_back(rule);
    set_up(added_.back());
    attach(*rules_.back());
    look(*rules_.back(), now());
  }
  line_.changed();
  // If one of the rules could not act at once, none of them is added.
  for (const Rule& rule : rules) {
    const auto joined =
        std::find_if(rules_.begin(), rules_.end(), [&rule](const auto& each) { return each->rule->name == rule.name; });
    const std::string error = (*joined)->error;
    if (error.empty()) continue;
    for (const Rule& each : rules) remove(each.name);
    throw ScenarioError(error, rule.name, "correct the rule");
  }
}

bool Director::remove(const std::string& name) {
  const auto found =
      std::find_if(rules_.begin(), rules_.end(), [&name](const auto& rule) { return rule->rule->name == name; });
  if (found == rules_.end()) return false;
  RuleRun& rule = **found;
  end(rule);
  release(rule, Time::max());
  for (const auto& segment : segments_) segment->let_go(&rule);
  if (rule.axis != nullptr && parts(*rule.axis).view) parts(*rule.axis).view->remove(rule);
  const Rule* text = rule.rule;
  rules_.erase(found);
  added_.remove_if([text](const Rule& each) { return &each == text; });
  line_.changed();
  return true;
}

bool Director::was_added(const std::string& name) const {
  return std::any_of(added_.begin(), added_.end(), [&name](const Rule& rule) { return rule.name == name; });
}

RuleRun* Director::run(std::size_t number) const {
  const auto found =
      std::find_if(rules_.begin(), rules_.end(), [number](const auto& rule) { return rule->number == number; });
  return found != rules_.end() ? found->get() : nullptr;
}

void Director::set_up(const Expectation& expectation) {
  const auto axis = [&](const Condition& condition) {
    line::Axis* its =
        axis_for(condition.axis.empty() ? expectation.axis : condition.axis, expectation.name, needs_axis(condition));
    check_object(condition, its, expectation.name);
    return its;
  };
  expectations_.emplace_back(expectation, axis(expectation.when), axis(expectation.what),
                             axis(expectation.until.value_or(Condition{})));
}

void Director::place_stages() {
  for (const auto& bus : line_.ethercat_buses()) segments_.push_back(std::make_unique<SegmentStage>(*this, *bus));
  for (const auto& bus : line_.serial_buses()) {
    tcp_stages_.push_back(std::make_unique<TcpStage>(*this, *bus));
    auto& station = stations_[bus.get()];
    if (!station) station = std::make_unique<RuleStation>(bus->line);
  }
  for (const auto& axis : line_.axes()) {
    const auto& bus = axis->settings().bus;
    if (bus) {
      links::CanBus& can = line_.buses()[*bus]->bus;
      auto& port = ports_[&can];
      if (!port) port = std::make_unique<RulePort>(can);
      parts(*axis).can = std::make_unique<CanStage>(*this, *axis, *port, can);
    }
    if (axis->device().ethercat_slave() != nullptr) parts(*axis).slave = std::make_unique<SlaveStage>(*this, *axis);
    if (const auto& serial = axis->settings().serial) {
      parts(*axis).serial = std::make_unique<SerialStage>(*this, *axis, *line_.serial_buses()[serial->bus]);
    }
  }
  for (const auto& rule : rules_) attach(*rule);
}

void Director::attach(RuleRun& rule) {
  if (!acts_on_view(rule.rule->action) || rule.axis == nullptr) return;
  std::unique_ptr<ObjectView>& view = parts(*rule.axis).view;
  if (!view) {
    view = std::make_unique<ObjectView>(*this, *rule.axis);
    rule.axis->device().bus_dictionary().set_view(view.get());
    // RS485 ports read the drive's own dictionary. So does the bench API, which then sees what the bus sees.
    if (rule.axis->settings().serial) rule.axis->device().dictionary().set_view(view.get());
  }
  view->add(rule);
}

Time Director::next_deadline() const {
  if (finished_) return links::never;
  return queue_.empty() ? looks_at_ : std::min(looks_at_, queue_.begin()->first);
}

void Director::reached(Time now) {
  while (!queue_.empty() && queue_.begin()->first <= now) {
    const auto due = queue_.extract(queue_.begin());
    due.mapped()();
  }
  if (now < looks_at_) return;
  looks_at_ = (now / line::tick_length + 1) * line::tick_length;
  constexpr Time record_period = std::chrono::milliseconds(1);
  if (now % record_period == Time{}) {
    for (auto& [axis, parts] : parts_) {
      if (parts.view) parts.view->record(now);
    }
  }
  measure_travel();
  master_.look(now);
  for (const auto& rule : rules_) look(*rule, now);
  for (ExpectationWatch& expectation : expectations_) {
    if (!expectation.decided()) expectation.look(now, facts_);
  }
}

void Director::measure_travel() {
  for (const auto& axis : line_.axes()) {
    const double position = revolutions(*axis);
    const auto [before, is_first] = revolutions_.try_emplace(axis.get(), position);
    facts_.travelled[axis.get()] += std::abs(position - before->second);
    before->second = position;
  }
}

void Director::master_ended(bool success) {
  facts_.master_ended = now();
  facts_.master_succeeded = success;
}

void Director::look(RuleRun& rule, Time now) {
  switch (rule.phase) {
    case RuleRun::Phase::waiting: {
      const bool wanted = rule.when.holds(now, facts_);
      const bool due = rule.rule->period && rule.begun && now >= rule.began + *rule.rule->period;
      if (wanted && (rule.ready || due)) begin(rule, now);
      rule.ready = rule.ready || !wanted;
      break;
    }
    case RuleRun::Phase::active: {
      const bool over = (rule.rule->lasts && now >= rule.began + *rule.rule->lasts) ||
                        (rule.until && rule.until->holds(now, facts_)) ||
                        (ends_with_its_acts(*rule.rule) && rule.exhausted());
      if (over) end(rule);
      break;
    }
    case RuleRun::Phase::over: break;
  }
}

void Director::begin(RuleRun& rule, Time now) {
  rule.phase = RuleRun::Phase::active;
  rule.began = now;
  rule.ready = false;
  rule.begun = true;
  ++rule.generation;
  rule.all_acts += rule.acts;
  rule.acts = rule.seen = 0;
  if (rule.until) rule.until->begin();
  if (AxisParts* with = rule.axis != nullptr ? &parts(*rule.axis) : nullptr; with != nullptr && with->view) {
    with->view->begin(rule);
  }
  if (!rule.rule->on) do_deed(rule);
}

void Director::end(RuleRun& rule) {
  if (rule.phase != RuleRun::Phase::active) return;
  undo_deed(rule);
  const bool again = rule.rule->again || rule.rule->period;
  rule.phase = again && !finished_ ? RuleRun::Phase::waiting : RuleRun::Phase::over;
  rule.when.begin();
}

void Director::act(RuleRun& rule, const Message* message, const Packets* packets) {
  rule.passed(true);
  acts_.add(rule, now(), message, packets);
  auto& first = facts_.first_acts[rule.rule->name];
  if (!first) first = now();
}

bool Director::concerns(const RuleRun& rule, line::Axis* axis, const Message& message) const {
  if (rule.phase != RuleRun::Phase::active || !rule.rule->on || !matches(*rule.rule->on, message)) return false;
  return is_of(rule.axis, rule.rule->bus, axis, message);
}

bool Director::is_of(const line::Axis* wanted, std::string_view bus, const line::Axis* axis,
                     const Message& message) const {
  if (wanted == nullptr && bus.empty()) return true;
  if (wanted == nullptr && message.bus.empty()) return axis != nullptr && is_on(*axis, bus);
  if (message.bus.empty()) return wanted == axis;
  if (wanted == nullptr) return bus == message.bus;
  const auto& slave = wanted->settings().ethercat;
  return slave && line_.ethercat_buses()[slave->bus]->settings.name == message.bus;
}

bool Director::is_on(const line::Axis& axis, std::string_view bus) const {
  const line::AxisSettings& on = axis.settings();
  return (on.bus && line_.buses()[*on.bus]->settings.name == bus) ||
         (on.serial && line_.serial_buses()[on.serial->bus]->settings.name == bus) ||
         (on.ethercat && line_.ethercat_buses()[on.ethercat->bus]->settings.name == bus);
}

bool Director::carry_out(line::Axis* axis, const Message& message, Packets& packets, std::vector<RuleRun*>* acting) {
  for (const auto& rule : rules_) {
    if (!concerns(*rule, axis, message) || !rule->fires(seed())) continue;
    packets.apply(*rule);
    if (acting != nullptr) acting->push_back(rule.get());
  }
  if (packets.unchanged()) return false;
  for (const auto& rule : rules_) {
    if (!concerns(*rule, axis, message)) continue;
    if (!rule->fires(seed())) {
      rule->passed(false);
    } else if (makes_messages(rule->rule->action)) {
      do_deed(*rule);
    } else {
      act(*rule, &message, &packets);
    }
  }
  notice(axis, message);
  return true;
}

void Director::carry_out(std::span<const Message> datagrams, std::vector<RuleRun*>& acting) {
  for (const auto& rule : rules_) {
    const bool is_concerned = std::any_of(datagrams.begin(), datagrams.end(),
                                          [&](const Message& datagram) { return concerns(*rule, nullptr, datagram); });
    if (!is_concerned) continue;
    if (!rule->fires(seed())) {
      rule->passed(false);
      continue;
    }
    if (makes_messages(rule->rule->action)) {
      do_deed(*rule);
      continue;
    }
    act(*rule, &datagrams.front());
    acting.push_back(rule.get());
  }
  notice(nullptr, datagrams);
}

bool Director::refuses_connections(const line::NamedSerialBus& bus) const {
  return std::any_of(rules_.begin(), rules_.end(), [&](const auto& rule) {
    const auto* accept = std::get_if<Accept>(&rule->rule->action);
    return accept != nullptr && !accept->on && rule->phase == RuleRun::Phase::active && serial_bus(*rule) == &bus;
  });
}

line::Axis* Director::axis_of_unit(const line::NamedSerialBus& bus, std::uint8_t unit) const {
  const modbus::Server* server = line_.find_unit(bus, unit);
  for (const auto& axis : line_.axes()) {
    products::SerialPort* port = axis->serial_port();
    if (server != nullptr && port != nullptr && port->modbus() == server) {
      return axis.get();
    }
  }
  return nullptr;
}

void Director::passed(line::Axis* axis, const Message& message) {
  for (const auto& rule : rules_) {
    if (concerns(*rule, axis, message)) rule->passed(false);
  }
  notice(axis, message);
}

void Director::notice(line::Axis* axis, std::span<const Message> parts) {
  if (parts.empty()) return;
  for (const auto& rule : rules_) {
    // A condition that names no axis is about the axis or the bus of its rule.
    const bool of_bus = rule->axis == nullptr && rule->rule->when.axis.empty();
    const line::Axis* wanted = of_bus ? nullptr : rule->when.axis();
    if (!is_of(wanted, rule->rule->bus, axis, parts.front())) continue;
    rule->when.notice(parts);
    if (rule->until) rule->until->notice(parts);
  }
  const auto concerns = [&](const Watch& watch) { return is_of(watch.axis(), {}, axis, parts.front()); };
  for (ExpectationWatch& expectation : expectations_) expectation.notice(parts, concerns);
}

void Director::hold(RuleRun& rule, const dictionary::Entry& entry, std::span<const std::byte> value, Time due) {
  HeldWrite write{.due = due, .start = rule.axis->starts(), .entry = &entry, .size = value.size()};
  std::copy(value.begin(), value.end(), write.bytes.begin());
  rule.held_writes.push_back(write);
  at(write.due, [this, number = rule.number] {
    if (RuleRun* present = run(number)) release(*present, now());
  });
}

// A drive forgets the delayed writes when it loses its power or is reset.
std::optional<Time> Director::held_until(const RuleRun& rule) {
  const auto& writes = rule.held_writes;
  if (writes.empty() || writes.back().start != rule.axis->starts()) return std::nullopt;
  return writes.back().due;
}

void Director::repeat(const RuleRun& rule, Time when, void (Director::*deed)(RuleRun&)) {
  at(when, [this, deed, number = rule.number, generation = rule.generation] {
    RuleRun* present = run(number);
    if (present != nullptr && present->generation == generation) (this->*deed)(*present);
  });
}

void Director::release(RuleRun& rule, Time due) {
  while (!rule.held_writes.empty() && rule.held_writes.front().due <= due) {
    const HeldWrite write = rule.held_writes.front();
    rule.held_writes.pop_front();
    if (rule.axis->powered() && rule.axis->starts() == write.start) {
      rule.axis->device().bus_dictionary().write_any(*write.entry, std::span(write.bytes).first(write.size));
    }
  }
}

void Director::finish() {
  if (finished_) return;
  finished_ = true;
  for (const auto& rule : rules_) {
    end(*rule);
    release(*rule, Time::max());
  }
  for (ExpectationWatch& expectation : expectations_) expectation.finish(now(), facts_);
  for (const auto& segment : segments_) segment->let_go();
  // Executes all queued actions now: a message that stayed in a mailbox would block it for ever.
  while (!queue_.empty()) queue_.extract(queue_.begin()).mapped()();
}

std::vector<RuleReport> Director::rules() const {
  std::vector<RuleReport> reports;
  for (const auto& rule : rules_) {
    reports.push_back({rule->rule->name, rule->rule->word,
                       rule->axis != nullptr ? rule->axis->settings().name : rule->rule->bus, rule->phase,
                       rule->acts + rule->all_acts, facts_.first_acts.find(rule->rule->name)->second, rule->error});
  }
  return reports;
}

std::vector<Verdict> Director::verdicts() const {
  std::vector<Verdict> verdicts;
  for (const ExpectationWatch& expectation : expectations_) verdicts.push_back(expectation.verdict());
  return verdicts;
}

}  // namespace servodrome::scenario
