#include "studio/ended_recording.hpp"

#include <fmt/format.h>

#include "links/number_text.hpp"

namespace servodrome::studio {

using api::ApiError;

std::shared_ptr<const api::Recording> ended_recording(const api::Call& call, const FindRecording& find) {
  const std::string_view text = call.arguments.front();
  const auto id = links::number_of_text<std::uint32_t>(text);
  auto recording = id ? find(*id) : nullptr;
  if (recording == nullptr) {
    throw ApiError{404, fmt::format("there is no recording \"{}\"", text.substr(0, 40)), "address",
                   "GET /api/v1/recordings lists them; the oldest make room for new ones"};
  }
  if (!recording->ended()) {
    throw ApiError{409, "the recording has not ended", std::string(text),
                   "wait for the state \"done\", or POST .../stop"};
  }
  return recording;
}

}  // namespace servodrome::studio
