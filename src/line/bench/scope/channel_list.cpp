#include "line/bench/scope/channel_list.hpp"

#include <charconv>
#include <cmath>
#include <fmt/format.h>

#include "drive/hardware.hpp"
#include "line/nearest_name.hpp"

namespace servodrome::line::bench {
namespace {

// "6064:00" or "6064": index and sub-index in hexadecimal.
bool parse_object(std::string_view text, std::uint16_t& index, std::uint8_t& sub) {
  const auto parse = [](std::string_view digits, auto& value) {
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
    return error == std::errc() && end == digits.data() + digits.size();
  };
  if (text.starts_with("0x")) text.remove_prefix(2);
  const std::size_t colon = std::min(text.find(':'), text.size());
  sub = 0;
  return parse(text.substr(0, colon), index) && (colon == text.size() || parse(text.substr(colon + 1), sub));
}

NamedChannel read_channel(Line& line, const Json& json) {
  BodyReader reader(json);
  reader.required("axis");
  Axis& axis = axis_of(line, reader.string("axis").value_or(""));
  const auto signal = reader.string("signal");
  const auto object = reader.string("object");
  reader.finish();
  if (signal.has_value() == object.has_value()) {
    throw ApiError{400, "a channel is a signal or an object", "channels",
                   R"(send {"axis": ..., "signal": "velocity_rpm"} or {"axis": ..., "object": "6064:00"})"};
  }
  if (signal) return named_signal(axis, *signal);
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  if (!parse_object(*object, index, sub)) {
    throw ApiError{400, fmt::format("\"{}\" is no object", object->substr(0, 40)), "channels",
                   "write index and sub-index in hexadecimal: \"6064:00\""};
  }
  return named_object(axis, index, sub);
}

}  // namespace

Axis& axis_of(Line& line, std::string_view name) {
  if (Axis* axis = line.find_axis(name)) return *axis;
  std::vector<std::string_view> names;
  for (const auto& axis : line.axes()) names.push_back(axis->settings().name);
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "axis", suggestion(name, names)};
}

NamedChannel named_signal(Axis& axis, std::string_view name) {
  const Channel channel = signal_channel(axis, name);
  if (channel.read == nullptr) {
    std::vector<std::string_view> names;
    for (const line::Signal& signal : line::signals()) names.push_back(signal.name);
    throw ApiError{
        422, fmt::format("there is no signal \"{}\"", name.substr(0, 40)), axis.settings().name,
        suggestion(name, names) + fmt::format("; inputs are DI0 .. DI{}", axis.settings().product->input_wires - 1)};
  }
  std::string_view unit;
  for (const line::Signal& signal : line::signals()) {
    if (signal.name == name) unit = signal.unit;
  }
  return {channel, {{"axis", axis.settings().name}, {"signal", name}, {"name", name}, {"unit", unit}}};
}

NamedChannel named_object(Axis& axis, std::uint16_t index, std::uint8_t sub) {
  const std::string text = fmt::format("{:04X}:{:02X}", index, sub);
  const dictionary::Entry* entry = axis.device().dictionary().find(index, sub);
  const Channel channel = entry != nullptr ? object_channel(axis, *entry) : Channel{};
  if (channel.read == nullptr) {
    throw ApiError{422, fmt::format("{} {}", text, entry == nullptr ? "does not exist" : "is no number to be read"),
                   axis.settings().name, "GET /api/v1/axes/" + axis.settings().name + "/objects lists the objects"};
  }
  return {channel, {{"axis", axis.settings().name}, {"object", text}, {"name", entry->name}, {"unit", entry->unit}}};
}

std::vector<NamedChannel> read_channels(Line& line, const Json& list) {
  if (!list.is_array() || list.empty() || list.size() > most_channels) {
    throw ApiError{422, "channels is no list of 1 to 16 channels", "channels",
                   R"(send [{"axis": ..., "signal": "velocity_rpm"}, ...])"};
  }
  std::vector<NamedChannel> channels;
  for (const Json& json : list) channels.push_back(read_channel(line, json));
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

}  // namespace servodrome::line::bench
