#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "api/routes.hpp"
#include "api/scope/recording.hpp"

namespace servodrome::studio {

// Returns nullptr if there is no such recording.
using FindRecording = std::function<std::shared_ptr<const api::Recording>(std::uint32_t id)>;

// The recording that the first argument of a call names. Throws ApiError: 404, or 409 if it has not ended.
std::shared_ptr<const api::Recording> ended_recording(const api::Call& call, const FindRecording& find);

}  // namespace servodrome::studio
