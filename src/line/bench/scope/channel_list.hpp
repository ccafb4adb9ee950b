#pragma once

#include <cstdint>
#include <vector>

#include "line/bench/body_reader.hpp"
#include "line/bench/scope/source.hpp"

// What a stream or a recording looks at, as requests write it.
namespace servodrome::line::bench {

inline constexpr std::size_t most_channels = 16;

// [{"axis": "x", "signal": "position_counts"}, {"axis": "x", "object": "6064:00"}]. Throws ApiError.
std::vector<NamedChannel> read_channels(Source& source, const Json& list);
Json views_of(const std::vector<NamedChannel>& channels);

// The stride, in ticks, of the divider of the tick rate that is nearest to a rate of 1 .. 16000 Hz.
std::int64_t stride_of_rate(double rate_hz);

}  // namespace servodrome::line::bench
