#include "api/scope/recordings.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "drive/hardware.hpp"

namespace servodrome::api {
namespace {

constexpr auto ticks_per_second = static_cast<double>(drive::ticks_per_second);
constexpr double longest_ms = 3'600'000;
constexpr std::size_t longest_name = 100;
constexpr std::size_t longest_note = 4000;

[[noreturn]] void too_large(std::size_t channels) {
  throw ApiError{422,
                 fmt::format("the recording has more than {} values in each of its {} channels",
                             Recordings::largest_bytes / sizeof(double) / channels, channels),
                 "duration_ms", "choose a shorter time, a lower rate or fewer channels"};
}

std::optional<std::string> text_of(BodyReader& reader, std::string_view key, std::size_t longest) {
  std::optional<std::string> text = reader.string(key);
  if (text && text->size() > longest) {
    throw ApiError{422, fmt::format("the text has {} bytes, more than {}", text->size(), longest), std::string(key),
                   "give a shorter text"};
  }
  return text;
}

}  // namespace

const Recording& Recordings::add(Source& source, const std::string& body) {
  BodyReader reader(body);
  Recording::Plan plan;
  plan.name = text_of(reader, "name", longest_name).value_or("");
  plan.note = text_of(reader, "note", longest_note).value_or("");
  plan.channels = read_channels(source, reader.required("channels"));
  const double asked_hz = reader.number("rate_hz", 1, ticks_per_second).value_or(ticks_per_second);
  Source::Prepared prepared = source.prepare(asked_hz, plan.channels);
  plan.stride = prepared.stride;
  plan.held = std::move(prepared.held);
  const double rate_hz = ticks_per_second / static_cast<double>(plan.stride);
  const double duration_ms = reader.number("duration_ms", 0, longest_ms).value_or(500);
  const double before_ms = reader.number("pre_ms", 0, longest_ms).value_or(0);
  plan.samples = std::max<std::int64_t>(1, std::llround(duration_ms * rate_hz / 1000));
  plan.before = std::llround(before_ms * rate_hz / 1000);
  if (plan.before >= plan.samples) {
    throw ApiError{422, "pre_ms is not less than duration_ms", "pre_ms",
                   "duration_ms is the whole recording, pre_ms the part of it before the trigger"};
  }
  static const Json now{{"kind", "now"}};
  ArmedTrigger trigger(source, reader.has("trigger") ? reader.required("trigger") : now, plan.channels,
                       source.trigger_stride(plan.stride));
  reader.finish();
  const std::size_t bytes = static_cast<std::size_t>(plan.samples) * plan.channels.size() * sizeof(double);
  if (bytes > largest_bytes) too_large(plan.channels.size());
  plan.id = last_id_ + 1;
  auto recording = std::make_shared<Recording>(std::move(plan), std::move(trigger));
  if (!make_room(bytes)) {
    throw ApiError{409, "no memory is left for another recording, because unfinished recordings use it", "recordings",
                   "delete one: DELETE /api/v1/recordings/{id}"};
  }
  ++last_id_;
  recordings_.push_back(std::move(recording));
  return *recordings_.back();
}

void Recordings::add_moment(Recording::Plan plan, std::vector<std::shared_ptr<Samples>> taps, std::int64_t first,
                            std::int64_t trigger, Recording::Fault fault) {
  const auto is_of_axis = [&](const auto& its) {
    return its->plan().fault_moment && its->fault() && its->fault()->axis == fault.axis;
  };
  if (static_cast<std::size_t>(std::count_if(recordings_.begin(), recordings_.end(), is_of_axis)) >=
      fault_moments_per_axis) {
    recordings_.erase(std::find_if(recordings_.begin(), recordings_.end(), is_of_axis));
  }
  const std::size_t bytes = static_cast<std::size_t>(plan.samples) * taps.size() * sizeof(double);
  if (!make_room(bytes)) return;  // recordings that have not ended use all the memory
  plan.id = ++last_id_;
  plan.fault_moment = true;
  recordings_.push_back(
      std::make_shared<Recording>(std::move(plan), std::move(taps), first, trigger, std::move(fault)));
  changed_(*recordings_.back());
}

void Recordings::describe(Recording& recording, const std::string& body) {
  BodyReader reader(body);
  std::optional<std::string> name = text_of(reader, "name", longest_name);
  std::optional<std::string> note = text_of(reader, "note", longest_note);
  reader.finish();
  if (name) recording.set_name(std::move(*name));
  if (note) recording.set_note(std::move(*note));
  changed_(recording);
}

void Recordings::take(std::int64_t end) {
  for (const auto& recording : recordings_) {
    if (recording->take(end)) changed_(*recording);
  }
}

std::shared_ptr<Recording> Recordings::find(std::uint32_t id) const {
  for (const auto& recording : recordings_) {
    if (recording->plan().id == id) return recording;
  }
  return nullptr;
}

void Recordings::erase(std::uint32_t id) {
  std::erase_if(recordings_, [id](const auto& recording) { return recording->plan().id == id; });
}

void Recordings::remove(std::uint32_t id) {
  erase(id);
  if (removed_) removed_(id);
}

void Recordings::restore(std::shared_ptr<Recording> recording) {
  if (!make_room(recording->bytes())) return;
  begin_after(recording->plan().id);
  recordings_.push_back(std::move(recording));
}

std::size_t Recordings::bytes() const {
  std::size_t bytes = 0;
  for (const auto& recording : recordings_) bytes += recording->bytes();
  return bytes;
}

// Deletes the oldest recordings that have ended. Returns false, and deletes nothing, if that does not make enough room.
bool Recordings::make_room(std::size_t bytes) {
  std::size_t used = this->bytes();
  std::size_t count = recordings_.size();
  std::vector<std::uint32_t> going;
  for (const auto& recording : recordings_) {
    if (used + bytes <= most_bytes && count < most) break;
    if (!recording->ended()) continue;
    going.push_back(recording->plan().id);
    used -= recording->bytes();
    --count;
  }
  if (used + bytes > most_bytes || count >= most) return false;
  for (const std::uint32_t id : going) erase(id);
  return true;
}

}  // namespace servodrome::api
