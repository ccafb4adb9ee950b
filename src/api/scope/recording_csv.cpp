#include "api/scope/recording_csv.hpp"

#include <cmath>
#include <fmt/format.h>
#include <iterator>

#include "drive/hardware.hpp"

namespace servodrome::api {
namespace {

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) result += c == '"' ? "\"\"" : std::string(1, c);
  return result + "\"";
}

}  // namespace

std::string csv_head(const Recording& recording, std::string_view line_end) {
  std::string head = "tick,time_s";
  for (const NamedChannel& channel : recording.plan().channels) {
    const auto word = [&](const char* key) { return channel.view.value(key, std::string()); };
    const std::string what = channel.view.contains("object") ? word("object") + " " + word("name") : word("name");
    const std::string unit = word("unit");
    head += "," + quoted(word("axis") + " " + what + (unit.empty() ? "" : " [" + unit + "]"));
  }
  return head.append(line_end);
}

void append_csv_row(std::string& text, const Recording& recording, std::int64_t row, std::string_view line_end) {
  const std::int64_t tick = recording.tick(row);
  fmt::format_to(std::back_inserter(text), "{},{:.7f}", tick, static_cast<double>(tick) * drive::tick_seconds);
  for (std::size_t channel = 0; channel < recording.plan().channels.size(); ++channel) {
    const double value = recording.value(channel, row);
    text += ',';
    if (!std::isnan(value)) fmt::format_to(std::back_inserter(text), "{}", value);
  }
  text.append(line_end);
}

}  // namespace servodrome::api
