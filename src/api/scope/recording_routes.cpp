#include <array>
#include <fmt/format.h>

#include "api/scope/ended_recording.hpp"
#include "api/scope/frame.hpp"
#include "api/scope/recording_files.hpp"
#include "api/scope/scope.hpp"

namespace servodrome::api {
namespace {

constexpr std::size_t bytes_at_a_time = 64 * 1024;
constexpr std::string_view csv_line_end = "\r\n";  // RFC 4180

Scope& scope_of(Call& call) { return *static_cast<Scope*>(call.context); }

FindRecording finder(Call& call) {
  return [&call](std::uint32_t id) { return scope_of(call).recordings().find(id); };
}

std::shared_ptr<Recording> recording_argument(Call& call) { return named_recording(call, finder(call)); }

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

// Generates the body in parts, as the files do.
Json show_data(Call& call) {
  const auto recording = ended_recording(call, finder(call));
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
  call.content =
      Content{"text/csv; charset=utf-8", {}, csv_parts_of(ended_recording(call, finder(call)), csv_line_end)};
  return nullptr;
}

Json show_mcap(Call& call) {
  const links::Time epoch = scope_of(call).source().wall_epoch();
  call.content = Content{"application/octet-stream", {}, mcap_parts_of(ended_recording(call, finder(call)), epoch)};
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
    Route{Method::get, "/api/v1/recordings/{}/data.mcap", show_mcap},
};

}  // namespace

std::span<const Route> recording_routes() { return recording_table; }

}  // namespace servodrome::api
