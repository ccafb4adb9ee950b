#pragma once

#include <cstdint>
#include <vector>

#include "line/bench/body_reader.hpp"
#include "line/line.hpp"
#include "line/tap.hpp"

// What a stream or a recording looks at, as requests write it.
namespace servodrome::line::bench {

inline constexpr std::size_t most_channels = 16;

struct NamedChannel {
  Channel channel;
  Json view;  // {"axis", "signal" or "object", "name", "unit"}
};

// [{"axis": "x", "signal": "position_counts"}, {"axis": "x", "object": "6064:00"}]. Throws ApiError.
std::vector<NamedChannel> read_channels(Line& line, const Json& list);
NamedChannel named_signal(Axis& axis, std::string_view name);                  // throws ApiError
NamedChannel named_object(Axis& axis, std::uint16_t index, std::uint8_t sub);  // throws ApiError
Json views_of(const std::vector<NamedChannel>& channels);

// The axis of a name. Throws ApiError 404.
Axis& axis_of(Line& line, std::string_view name);

// The stride, in ticks, of the divider of the tick rate that is nearest to a rate of 1 .. 16000 Hz.
std::int64_t stride_of_rate(double rate_hz);

}  // namespace servodrome::line::bench
