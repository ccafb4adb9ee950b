#include "scenario/object_view.hpp"

#include <algorithm>
#include <cmath>

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

std::int64_t ObjectView::present(const ObjectAddress& object) const {
  return axis_.device().dictionary().number(object.index, object.sub.value_or(0));
}

void ObjectView::begin(RuleRun& rule) const {
  if (const auto* show = std::get_if<Show>(&rule.rule->action)) rule.frozen = present(show->object);
  rule.history.clear();
  rule.raised = 0;
}

void ObjectView::record(Time now) const {
  for (RuleRun* rule : rules_) {
    const auto* show = std::get_if<Show>(&rule->rule->action);
    if (show == nullptr || show->how != Show::How::late || rule->phase == RuleRun::Phase::over) continue;
    rule->history.push_back({now, present(show->object)});
    while (rule->history.size() > 1 && rule->history[1].at <= now - show->time) rule->history.pop_front();
  }
}

std::int64_t ObjectView::shown(const RuleRun& rule, const Show& show, std::int64_t value) const {
  const Time now = director_.now();
  switch (show.how) {
    case Show::How::value: return mixed(value, show.number, show.mask);
    case Show::How::freeze: return mixed(value, rule.frozen, show.mask);
    case Show::How::set_bits: return value | show.number;
    case Show::How::clear_bits: return value & ~show.number;
    case Show::How::flip_bits: return (now - rule.began) / show.time % 2 == 0 ? value ^ show.number : value;
    case Show::How::add: return value + show.number;
    case Show::How::negate: return -value;
    case Show::How::late: return rule.history.empty() ? value : mixed(value, rule.history.front().value, show.mask);
    case Show::How::drift: {
      const double seconds = std::chrono::duration<double>(now - rule.began).count();
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
    put(value, shown(*rule, *show, dictionary::decode_number(entry.type, value)));
  }
}

bool ObjectView::take(const dictionary::Entry& entry, std::span<std::byte> value) {
  for (RuleRun* rule : rules_) {
    const ObjectAddress* object = object_of(rule->rule->action);
    if (!object->contains(entry.index, entry.sub)) continue;
    if (director_.now() < rule->held_until) {  // a later write must not take effect before a delayed one
      director_.hold(*rule, entry, value);
      return false;
    }
    if (rule->phase != RuleRun::Phase::active) continue;
    if (const auto* hold = std::get_if<Hold>(&rule->rule->action)) {
      if (rule->exhausted()) continue;
      director_.act(*rule);
      rule->held_until = director_.now() + hold->time;
      director_.hold(*rule, entry, value);
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
    if ((bits & ~rule->raised) != 0) {
      if (rule->exhausted()) {
        director_.end(*rule);
        continue;
      }
      director_.act(*rule);
    }
    rule->raised = bits;
    put(value, mixed(wanted, present(*object), ignore->mask));
  }
  return true;
}

}  // namespace servodrome::scenario
