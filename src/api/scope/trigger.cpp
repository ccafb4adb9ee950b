#include "api/scope/trigger.hpp"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <string_view>

#include "drive/power/power_state.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::api {
namespace {

// Returns the index of `word` among `words`. Throws ApiError 422 if it is not one of them.
std::size_t place_of(const std::string& word, std::span<const std::string_view> words, std::string_view key) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == word) return i;
  }
  throw ApiError{422, fmt::format("{} is \"{}\"", key, word.substr(0, 40)), std::string(key),
                 links::suggestion(word, {words.begin(), words.end()})};
}

double state_of(const std::string& name) {
  std::vector<std::string_view> names;
  for (unsigned state = 0; state <= static_cast<unsigned>(drive::PowerState::fault); ++state) {
    names.emplace_back(drive::name(static_cast<drive::PowerState>(state)));
  }
  return static_cast<double>(place_of(name, names, "state"));
}

}  // namespace

Trigger::Trigger(Source& source, const Json& json, const std::vector<NamedChannel>& channels, std::int64_t stride) {
  static constexpr std::array<std::string_view, 5> kinds{"now", "edge", "level", "state", "fault"};
  static constexpr std::array<std::string_view, 2> slopes{"rising", "falling"};
  BodyReader reader(json);
  reader.required("kind");
  kind_ = static_cast<Kind>(place_of(reader.string("kind").value_or(""), kinds, "kind"));
  switch (kind_) {
    case Kind::now: watch(channels.front(), stride); break;
    case Kind::edge:
    case Kind::level: {
      const auto place = reader.integer("channel", channels.size() - 1).value_or(0);
      reader.required("level");
      level_ = reader.number("level").value_or(0);
      rising_ = place_of(reader.string("slope").value_or("rising"), slopes, "slope") == 0;
      watch(channels[place], stride);
      break;
    }
    case Kind::state: {
      const std::string axis = reader.string("axis").value_or(channels.front().axis);
      if (const auto state = reader.string("state")) state_ = state_of(*state);
      watch(source.signal(axis, "state"), stride);
      break;
    }
    case Kind::fault: {
      if (const auto name = reader.string("axis")) {
        watch(source.signal(*name, "fault_code"), stride);
      } else {
        for (const std::string& axis : source.axes()) watch(source.signal(axis, "fault_code"), stride);
      }
      break;
    }
  }
  reader.finish();
}

void Trigger::watch(const NamedChannel& channel, std::int64_t stride) {
  auto samples = channel.open(stride);
  const std::int64_t next = samples->due();
  watched_.push_back({channel.axis, std::move(samples), next, channel.value()});
}

// Comparisons with not-a-number are false, so an axis without power triggers nothing.
bool Trigger::happens(double previous, double value) const {
  const auto beyond = [this](double its) { return rising_ ? its >= level_ : its <= level_; };
  switch (kind_) {
    case Kind::now: return true;
    case Kind::level: return beyond(value);
    case Kind::edge: return (rising_ ? previous < level_ : previous > level_) && beyond(value);
    case Kind::state: {
      const bool changed = !std::isnan(value) && previous != value;
      return changed && (!state_ || *state_ == value);
    }
    case Kind::fault: return value > 0 && !(previous > 0);
  }
  return false;
}

std::optional<Trigger::Hit> Trigger::find(Watched& watched, std::int64_t end) const {
  for (; watched.next < end; watched.next += watched.samples->stride()) {
    const double value = watched.samples->at(watched.next);
    if (happens(watched.previous, value)) return Hit{watched.next, watched.axis, value};
    // An edge may lie between two known values with unknown ones in between, so unknown values are skipped.
    if (kind_ != Kind::edge || !std::isnan(value)) watched.previous = value;
  }
  return std::nullopt;
}

std::optional<Trigger::Hit> Trigger::find(std::int64_t end) {
  std::optional<Hit> first;
  for (Watched& watched : watched_) {
    const auto hit = find(watched, first ? first->tick : end);
    if (hit) first = hit;
  }
  return first;
}

}  // namespace servodrome::api
