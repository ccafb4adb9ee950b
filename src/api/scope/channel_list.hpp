#pragma once

#include <cstdint>
#include <vector>

#include "api/body_reader.hpp"
#include "api/scope/source.hpp"

// The channels of a stream or a recording, as requests list them.
namespace servodrome::api {

inline constexpr std::size_t most_channels = 16;

// Reads [{"axis": "x", "signal": "position_counts"}, {"axis": "x", "object": "6064:00"}]. Throws ApiError.
std::vector<NamedChannel> read_channels(Source& source, const Json& list);
Json views_of(const std::vector<NamedChannel>& channels);

// Returns the stride in ticks whose rate is nearest to `rate_hz` (1 .. 16000 Hz), among the divisors of the tick rate.
std::int64_t stride_of_rate(double rate_hz);

}  // namespace servodrome::api
