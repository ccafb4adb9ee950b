#include "api/scope/ended_recording.hpp"

#include <fmt/format.h>

#include "links/number_text.hpp"

namespace servodrome::api {

std::shared_ptr<Recording> named_recording(const Call& call, const FindRecording& find) {
  const std::string_view text = call.arguments.front();
  const auto id = links::number_of_text<std::uint32_t>(text);
  if (auto recording = id ? find(*id) : nullptr) return recording;
  throw ApiError{404, fmt::format("there is no recording \"{}\"", text.substr(0, 40)), "address",
                 "GET /api/v1/recordings lists them; the oldest make room for new ones"};
}

std::shared_ptr<const Recording> ended_recording(const Call& call, const FindRecording& find) {
  auto recording = named_recording(call, find);
  if (recording->ended()) return recording;
  throw ApiError{409, "the recording has not ended", std::string(call.arguments.front()),
                 "wait for the state \"done\", or POST .../stop"};
}

}  // namespace servodrome::api
