#include "scenario/object_view.hpp"

#include <algorithm>
#include <cmath>

#include "links/time.hpp"
#include "scenario/director.hpp"

namespace servodrome::scenario {
namespace {

void put(std::span<std::byte> to, std::int64_t value) {
  const auto bytes = dictionary::encode_number(value);
  std::copy_n(bytes.begin(), to.size(), to.begin());
}

std::int64_t mixed(std::int64_t value, std::int64_t other, std::int64_t mask) {
  return (value & ~mask) | (other & mask);
}

}  // namespace

std::int64_t ObjectView::present(std::uint16_t index, std::uint8_t sub) const {
  return axis_.device().dictionary().number(index, sub);
}

void ObjectView::add(RuleRun& rule) {
  rules_.push_back(&rule);
  const ObjectAddress& object = *object_of(rule.rule->action);
  // RS485 ports use the drive's own dictionary.
  for (const auto& table : {axis_.device().bus_dictionary().table(), axis_.device().dictionary().table()}) {
    for (const dictionary::Entry& entry : table) {
      if (entry.fixed_size() && object.contains(entry.index, entry.sub)) rule.memories.try_emplace(entry.sub);
    }
  }
}

void ObjectView::begin(RuleRun& rule) const {
  const ObjectAddress* object = object_of(rule.rule->action);
  if (object == nullptr) return;
  for (auto& [sub, memory] : rule.memories) {
    memory = {};
    memory.frozen = present(object->index, sub);
  }
}

void ObjectView::record(Time now) const {
  for (RuleRun* rule : rules_) {
    const auto* show = std::get_if<Show>(&rule->rule->action);
    if (show == nullptr || show->how != Show::How::late || rule->phase == RuleRun::Phase::over) continue;
    for (auto& [sub, memory] : rule->memories) {
      std::deque<PastValue>& history = memory.history;
      history.push_back({now, present(show->object.index, sub)});
      while (history.size() > 1 && history[1].at <= now - show->time) history.pop_front();
    }
  }
}

std::int64_t ObjectView::shown(const RuleRun& rule, const Show& show, std::uint8_t sub, std::int64_t value) const {
  const Time now = director_.now();
  const ObjectMemory& memory = rule.memories.at(sub);
  switch (show.how) {
    case Show::How::value: return mixed(value, show.number, show.mask);
    case Show::How::freeze: return mixed(value, memory.frozen, show.mask);
    case Show::How::set_bits: return value | show.number;
    case Show::How::clear_bits: return value & ~show.number;
    case Show::How::flip_bits: return (now - rule.began) / show.time % 2 == 0 ? value ^ show.number : value;
    case Show::How::add: return value + show.number;
    case Show::How::negate: return -value;
    case Show::How::late: return memory.history.empty() ? value : mixed(value, memory.history.front().value, show.mask);
    case Show::How::drift: {
      const double seconds = links::to_seconds(now - rule.began);
      return value + std::llround(static_cast<double>(show.number) * seconds);
    }
  }
  return value;
}

void ObjectView::show(const dictionary::Entry& entry, std::span<std::byte> value) {
  for (RuleRun* rule : rules_) {
    const auto* show = std::get_if<Show>(&rule->rule->action);
    if (show == nullptr || rule->phase != RuleRun::Phase::active) continue;
    if (!show->object.contains(entry.index, entry.sub)) continue;
    put(value, shown(*rule, *show, entry.sub, dictionary::decode_number(entry.type, value)));
  }
}

bool ObjectView::take(const dictionary::Entry& entry, std::span<std::byte> value) {
  for (RuleRun* rule : rules_) {
    const ObjectAddress* object = object_of(rule->rule->action);
    if (!object->contains(entry.index, entry.sub)) continue;
    if (const auto until = Director::held_until(*rule)) {  // a later write must not take effect before a delayed one
      director_.hold(*rule, entry, value, *until);
      return false;
    }
    if (rule->phase != RuleRun::Phase::active) continue;
    if (const auto* hold = std::get_if<Hold>(&rule->rule->action)) {
      if (rule->exhausted()) continue;
      director_.act(*rule);
      director_.hold(*rule, entry, value, director_.now() + hold->time);
      return false;
    }
    const auto* ignore = std::get_if<Ignore>(&rule->rule->action);
    if (ignore == nullptr) continue;
    const std::int64_t wanted = dictionary::decode_number(entry.type, value);
    if (ignore->mask == -1) {
      if (rule->exhausted()) continue;
      director_.act(*rule);
      return false;
    }
    // A write that sets a masked bit counts as an act. Later writes with the bit still set, as in each cycle, do not.
    const auto mask = static_cast<std::uint64_t>(ignore->mask);
    const std::uint64_t bits = static_cast<std::uint64_t>(wanted) & mask;
    std::uint64_t& raised = rule->memories.at(entry.sub).raised;
    if ((bits & ~raised) != 0) {
      if (rule->exhausted()) {
        director_.end(*rule);
        continue;
      }
      director_.act(*rule);
    }
    raised = bits;
    put(value, mixed(wanted, present(entry.index, entry.sub), ignore->mask));
  }
  return true;
}

}  // namespace servodrome::scenario
