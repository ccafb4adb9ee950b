#include "api/scope/recording_files.hpp"

#include <algorithm>
#include <cctype>
#include <fmt/format.h>

#include "drive/hardware.hpp"
#include "scope/files.hpp"

namespace servodrome::api {
namespace {

constexpr scope::Time tick_length{62'500};  // drive::tick_seconds, exactly

std::string word(const Json& view, const char* key) { return view.value(key, std::string()); }

// "ax velocity_rpm", "ax 6064:00 Position actual value".
std::string column_name(const Json& view) {
  const std::string object = view.contains("object") ? word(view, "object") + " " : "";
  return word(view, "axis") + " " + object + word(view, "name");
}

// "following_error" for a signal; "following_error_actual_value_60F4_00" for an object.
std::string field_name(const Json& view) {
  if (view.contains("signal")) return word(view, "signal");
  std::string field;
  for (const char c : word(view, "name")) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0) {
      field += static_cast<char>(std::tolower(byte));
    } else if (!field.empty() && field.back() != '_') {
      field += '_';
    }
  }
  std::string object = word(view, "object");
  std::replace(object.begin(), object.end(), ':', '_');
  return field + (field.ends_with('_') ? "" : "_") + object;
}

// All channels are one group.
scope::Table table_of(const std::shared_ptr<const Recording>& recording, std::string (*name_of)(const Json& view)) {
  scope::Table table;
  for (const NamedChannel& channel : recording->plan().channels) {
    table.channels.push_back({name_of(channel.view), word(channel.view, "unit")});
  }
  table.groups.assign(table.channels.size(), 0);
  table.rows = static_cast<std::size_t>(recording->samples());
  table.source = recording->plan().name;
  table.way = fmt::format("every {} us", static_cast<double>(recording->plan().stride) * drive::tick_seconds * 1e6);
  table.value = [recording](std::size_t row, std::size_t channel) {
    return recording->value(channel, static_cast<std::int64_t>(row));
  };
  table.time = [recording](std::size_t row, std::size_t) {
    return recording->tick(static_cast<std::int64_t>(row)) * tick_length;
  };
  return table;
}

}  // namespace

std::function<std::string()> csv_parts_of(std::shared_ptr<const Recording> recording, std::string_view line_end) {
  scope::Table table = table_of(recording, column_name);
  scope::CsvFormat format{.line_end = line_end, .time_name = "time_s", .time_decimals = 7};
  format.tick = [recording = std::move(recording)](std::size_t row) {
    return recording->tick(static_cast<std::int64_t>(row));
  };
  return scope::csv_parts_of(std::move(table), std::move(format));
}

std::function<std::string()> mcap_parts_of(std::shared_ptr<const Recording> recording, links::Time epoch) {
  scope::Table table = table_of(recording, field_name);
  std::vector<std::string> axes;
  for (std::size_t i = 0; i < table.channels.size(); ++i) {
    const std::string& axis = recording->plan().channels[i].axis;
    const auto known = std::find(axes.begin(), axes.end(), axis);
    table.groups[i] = static_cast<std::size_t>(known - axes.begin());
    if (known == axes.end()) axes.push_back(axis);
  }
  for (const std::string& axis : axes) table.topics.push_back("/" + axis);
  table.zero_unix_ns = epoch.count();
  return scope::mcap_parts_of(std::move(table));
}

}  // namespace servodrome::api
