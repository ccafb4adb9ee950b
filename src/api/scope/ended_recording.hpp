#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "api/routes.hpp"
#include "api/scope/recording.hpp"

namespace servodrome::api {

// Returns nullptr if there is no such recording.
using FindRecording = std::function<std::shared_ptr<Recording>(std::uint32_t id)>;

// The recording that the first argument of a call names. Throws ApiError 404.
std::shared_ptr<Recording> named_recording(const Call& call, const FindRecording& find);
// The same for a recording that has ended, so its samples do not change any more. Throws ApiError: 404, or 409 if it
// has not ended.
std::shared_ptr<const Recording> ended_recording(const Call& call, const FindRecording& find);

}  // namespace servodrome::api
