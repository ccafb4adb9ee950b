#include "api/scope/channel_list.hpp"

#include <cmath>
#include <fmt/format.h>

#include "drive/hardware.hpp"
#include "links/number_text.hpp"

namespace servodrome::api {
namespace {

// Reads "6064:00" or "6064": index and sub-index in hexadecimal.
bool parse_object(std::string_view text, std::uint16_t& index, std::uint8_t& sub) {
  const auto parse = [](std::string_view digits, auto& value) {
    const auto read = links::number_of_text<std::decay_t<decltype(value)>>(digits, 16);
    if (read) value = *read;
    return read.has_value();
  };
  if (text.starts_with("0x")) text.remove_prefix(2);
  const std::size_t colon = std::min(text.find(':'), text.size());
  sub = 0;
  return parse(text.substr(0, colon), index) && (colon == text.size() || parse(text.substr(colon + 1), sub));
}

NamedChannel read_channel(Source& source, const Json& json, std::size_t place) {
  const std::string where = fmt::format("channels[{}]", place);
  BodyReader reader(where, json);
  reader.required("axis");
  const std::string axis = reader.string("axis").value_or("");
  const auto signal = reader.string("signal");
  const auto object = reader.string("object");
  reader.finish();
  if (signal.has_value() == object.has_value()) {
    throw ApiError{400, "a channel needs either a signal or an object", where,
                   R"(send {"axis": ..., "signal": "velocity_rpm"} or {"axis": ..., "object": "6064:00"})"};
  }
  if (signal) return source.signal(axis, *signal);
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  if (!parse_object(*object, index, sub)) {
    throw ApiError{400, fmt::format("\"{}\" is not an object", object->substr(0, 40)), where,
                   "write index and sub-index in hexadecimal: \"6064:00\""};
  }
  return source.object(axis, index, sub);
}

}  // namespace

std::vector<NamedChannel> read_channels(Source& source, const Json& list) {
  if (!list.is_array() || list.empty() || list.size() > most_channels) {
    throw ApiError{422, "channels is not a list of 1 to 16 channels", "channels",
                   R"(send [{"axis": ..., "signal": "velocity_rpm"}, ...])"};
  }
  std::vector<NamedChannel> channels;
  for (const Json& json : list) channels.push_back(read_channel(source, json, channels.size()));
  return channels;
}

Json views_of(const std::vector<NamedChannel>& channels) {
  Json views = Json::array();
  for (const NamedChannel& channel : channels) views.push_back(channel.view);
  return views;
}

std::int64_t stride_of_rate(double rate_hz) {
  constexpr auto most = static_cast<double>(drive::ticks_per_second);
  std::int64_t best = 1;
  for (std::int64_t stride = 1; stride <= drive::ticks_per_second; ++stride) {
    if (drive::ticks_per_second % stride != 0) continue;
    const auto distance = [rate_hz](std::int64_t its) { return std::abs(most / static_cast<double>(its) - rate_hz); };
    if (distance(stride) < distance(best)) best = stride;
  }
  return best;
}

}  // namespace servodrome::api
