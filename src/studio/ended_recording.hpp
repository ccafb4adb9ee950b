#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "line/bench/routes.hpp"
#include "line/bench/scope/recording.hpp"

namespace servodrome::studio {

// Returns nullptr if there is no such recording.
using FindRecording = std::function<std::shared_ptr<const line::bench::Recording>(std::uint32_t id)>;

// The recording that the first argument of a call names. Throws ApiError: 404, or 409 if it has not ended.
std::shared_ptr<const line::bench::Recording> ended_recording(const line::bench::Call& call, const FindRecording& find);

}  // namespace servodrome::studio
