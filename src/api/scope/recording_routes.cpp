#include <array>
#include <fmt/format.h>

#include "api/scope/frame.hpp"
#include "api/scope/recording_csv.hpp"
#include "api/scope/scope.hpp"
#include "links/number_text.hpp"

namespace servodrome::api {
namespace {

constexpr std::int64_t samples_at_a_time = 1024;
constexpr std::size_t bytes_at_a_time = 64 * 1024;
constexpr std::string_view csv_line_end = "\r\n";  // RFC 4180

Scope& scope_of(Call& call) { return *static_cast<Scope*>(call.context); }

std::shared_ptr<Recording> recording_argument(Call& call) {
  const std::string_view text = call.arguments.front();
  if (const auto id = links::number_of_text<std::uint32_t>(text)) {
    if (auto recording = scope_of(call).recordings().find(*id)) return recording;
  }
  throw ApiError{404, fmt::format("there is no recording \"{}\"", text.substr(0, 40)), "address",
                 "GET /api/v1/recordings lists them; the oldest make room for new ones"};
}

// Returns a recording that has ended, so that its samples do not change while they are read.
std::shared_ptr<const Recording> snapshot(Call& call) {
  const auto recording = recording_argument(call);
  if (recording->ended()) return recording;
  throw ApiError{409, "the recording has not ended", std::string(call.arguments.front()),
                 "wait for the state \"done\", or POST .../stop"};
}

Json start_recording(Call& call) {
  Scope& scope = scope_of(call);
  return scope.recordings().add(scope.source(), call.body).view();
}

Json list_recordings(Call& call) {
  const Recordings& recordings = scope_of(call).recordings();
  Json list = Json::array();
  for (const auto& recording : recordings.all()) list.push_back(recording->view());
  return {{"recordings", std::move(list)}, {"bytes", recordings.bytes()}, {"most_bytes", Recordings::most_bytes}};
}

Json show_recording(Call& call) { return recording_argument(call)->view(); }

Json describe_recording(Call& call) {
  const auto recording = recording_argument(call);
  scope_of(call).recordings().describe(*recording, call.body);
  return recording->view();
}

Json stop_recording(Call& call) {
  const auto recording = recording_argument(call);
  recording->stop();
  return recording->view();
}

Json delete_recording(Call& call) {
  scope_of(call).recordings().remove(recording_argument(call)->plan().id);
  return nullptr;
}

// Generates the body in parts: formatting up to 16 MiB at once would take longer than a drive may wait.
Json show_data(Call& call) {
  const auto recording = snapshot(call);
  const auto channels = static_cast<std::uint32_t>(recording->plan().channels.size());
  const FrameHeader header{.id = recording->plan().id,
                           .stride = static_cast<std::uint32_t>(recording->plan().stride),
                           .first_tick = static_cast<std::uint64_t>(recording->tick(0)),
                           .samples = static_cast<std::uint32_t>(recording->samples()),
                           .channels = channels};
  call.content = Content{"application/octet-stream", head_of_frame(header)};
  call.content->more = [recording, channels, channel = std::uint32_t{0}, next = std::int64_t{0}]() mutable {
    std::string bytes;
    for (; channel < channels && bytes.size() < bytes_at_a_time; ++channel, next = 0) {
      for (; next < recording->samples() && bytes.size() < bytes_at_a_time; ++next) {
        const double value = recording->value(channel, next);
        append(bytes, &value, sizeof value);
      }
      if (next < recording->samples()) break;
    }
    return bytes;
  };
  return nullptr;
}

Json show_csv(Call& call) {
  const auto recording = snapshot(call);
  call.content = Content{"text/csv; charset=utf-8", csv_head(*recording, csv_line_end)};
  call.content->more = [recording, next = std::int64_t{0}]() mutable {
    std::string text;
    const std::int64_t end = std::min(next + samples_at_a_time, recording->samples());
    for (; next < end; ++next) append_csv_row(text, *recording, next, csv_line_end);
    return text;
  };
  return nullptr;
}

constexpr std::array recording_table{
    Route{Method::post, "/api/v1/recordings", start_recording, 201},
    Route{Method::get, "/api/v1/recordings", list_recordings},
    Route{Method::get, "/api/v1/recordings/{}", show_recording},
    Route{Method::put, "/api/v1/recordings/{}", describe_recording},
    Route{Method::delete_, "/api/v1/recordings/{}", delete_recording},
    Route{Method::post, "/api/v1/recordings/{}/stop", stop_recording},
    Route{Method::get, "/api/v1/recordings/{}/data", show_data},
    Route{Method::get, "/api/v1/recordings/{}/data.csv", show_csv},
};

}  // namespace

std::span<const Route> recording_routes() { return recording_table; }

}  // namespace servodrome::api
