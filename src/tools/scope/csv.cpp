#include <fmt/format.h>

#include "tools/scope/export.hpp"

namespace servodrome::master::scope {

namespace {

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

// Channels in the order of output: group by group.
std::vector<std::size_t> channels_by_group(const Recording& recording) {
  std::vector<std::size_t> order;
  for (std::size_t group = 0; group < recording.group_count; ++group) {
    for (std::size_t i = 0; i < recording.channels.size(); ++i) {
      if (recording.groups[i] == group) order.push_back(i);
    }
  }
  return order;
}

}  // namespace

std::string csv_of(const Recording& recording) {
  const std::vector<std::size_t> order = channels_by_group(recording);
  const auto begins_group = [&](std::size_t place) {
    return place == 0 || recording.groups[order[place]] != recording.groups[order[place - 1]];
  };
  std::string text;
  for (std::size_t place = 0; place < order.size(); ++place) {
    const Channel& channel = recording.channels[order[place]];
    if (place == 0) text += "seconds";
    if (place != 0 && begins_group(place)) text += ",seconds_" + channel.name;
    text += ',' + csv_field(channel.unit.empty() ? channel.name : fmt::format("{} [{}]", channel.name, channel.unit));
  }
  text += '\n';
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    for (std::size_t place = 0; place < order.size(); ++place) {
      const std::size_t channel = order[place];
      if (begins_group(place)) {
        text += fmt::format("{}{:.9f}", place == 0 ? "" : ",", recording.seconds(row, channel));
      }
      text += ',' + text_of_number(recording.value(row, channel));
    }
    text += '\n';
  }
  return text;
}

}  // namespace servodrome::master::scope
