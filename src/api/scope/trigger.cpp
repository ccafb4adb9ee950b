#include "api/scope/trigger.hpp"

#include <array>
#include <fmt/format.h>
#include <string_view>

#include "drive/power/power_state.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::api {
namespace {

using scope::Condition;

[[noreturn]] void refuse(const std::string& word, std::string_view key, std::span<const std::string_view> words) {
  throw ApiError{422, fmt::format("{} is \"{}\"", key, word.substr(0, 40)), std::string(key),
                 links::suggestion(word, {words.begin(), words.end()})};
}

double state_of(const std::string& name) {
  std::vector<std::string_view> names;
  for (unsigned state = 0; state <= static_cast<unsigned>(drive::PowerState::fault); ++state) {
    names.emplace_back(drive::name(static_cast<drive::PowerState>(state)));
    if (names.back() == name) return state;
  }
  refuse(name, "state", names);
}

// The short forms of conditions on a channel: "edge" and "level" with a slope, which is "rising" or "falling".
Condition condition_of_slope(bool is_edge, BodyReader& reader) {
  static constexpr std::array<std::string_view, 2> slopes{"rising", "falling"};
  const std::string slope = reader.string("slope").value_or("rising");
  if (slope == slopes[0]) return is_edge ? Condition::rises : Condition::at_least;
  if (slope == slopes[1]) return is_edge ? Condition::falls : Condition::at_most;
  refuse(slope, "slope", slopes);
}

}  // namespace

ArmedTrigger::ArmedTrigger(Source& source, const Json& json, const std::vector<NamedChannel>& channels,
                           std::int64_t stride) {
  BodyReader reader("trigger", json);
  reader.required("kind");
  const std::string kind = reader.string("kind").value_or("");
  if (kind == "state") {
    const std::string axis = reader.string("axis").value_or(channels.front().axis);
    const auto state = reader.string("state");
    trigger_ = state ? scope::Trigger{Condition::becomes, state_of(*state)} : scope::Trigger{Condition::changes};
    watch(source.signal(axis, "state"), stride);
  } else if (kind == "fault") {
    trigger_ = {Condition::appears};
    is_fault_ = true;
    const auto axis = reader.string("axis");
    for (const std::string& each : axis ? std::vector{*axis} : source.axes()) {
      watch(source.signal(each, "fault_code"), stride);
    }
  } else {
    const bool has_slope = kind == "edge" || kind == "level";
    const auto condition = has_slope ? condition_of_slope(kind == "edge", reader) : scope::condition_of(kind);
    if (!condition) {
      std::vector<std::string_view> kinds{"edge", "level", "state", "fault"};
      for (const std::string_view word : scope::condition_words()) kinds.push_back(word);
      refuse(kind, "kind", kinds);
    }
    trigger_.condition = *condition;
    std::uint64_t place = 0;
    if (*condition != Condition::now) place = reader.integer("channel", channels.size() - 1).value_or(0);
    if (scope::takes_value(*condition)) {
      const char* key = has_slope ? "level" : "value";
      reader.required(key);
      trigger_.value = reader.number(key).value_or(0);
    }
    watch(channels[place], stride);
  }
  reader.finish();
}

void ArmedTrigger::watch(const NamedChannel& channel, std::int64_t stride) {
  auto samples = channel.open(stride);
  const std::int64_t next = samples->due();
  watched_.push_back({channel.axis, std::move(samples), next, channel.value()});
}

std::optional<ArmedTrigger::Hit> ArmedTrigger::find(Watched& watched, std::int64_t end) const {
  for (; watched.next < end; watched.next += watched.samples->stride()) {
    const double value = watched.samples->at(watched.next);
    if (trigger_.fires(watched.before, value)) return Hit{watched.next, watched.axis, value};
    watched.before = trigger_.next_before(watched.before, value);
  }
  return std::nullopt;
}

std::optional<ArmedTrigger::Hit> ArmedTrigger::find(std::int64_t end) {
  std::optional<Hit> first;
  for (Watched& watched : watched_) {
    const auto hit = find(watched, first ? first->tick : end);
    if (hit) first = hit;
  }
  return first;
}

}  // namespace servodrome::api
