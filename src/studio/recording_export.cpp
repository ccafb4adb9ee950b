#include "studio/recording_export.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>

#include "line/axis.hpp"
#include "tools/scope/export.hpp"

namespace servodrome::studio {
namespace {

using api::Call;
using api::Json;
using api::Method;
using api::Recording;
using api::Route;

// "following_error" for a signal; "following_error_actual_value_60F4_00" for an object.
std::string field_name(const Json& channel) {
  if (channel.contains("signal")) return channel.value("signal", std::string());
  std::string field;
  for (const char c : channel.value("name", std::string())) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0) {
      field += static_cast<char>(std::tolower(byte));
    } else if (!field.empty() && field.back() != '_') {
      field += '_';
    }
  }
  std::string object = channel.value("object", std::string());
  std::replace(object.begin(), object.end(), ':', '_');
  return field + (field.ends_with('_') ? "" : "_") + object;
}

// One topic for each axis; its channels are the fields of the messages.
master::scope::Table table_of(std::shared_ptr<const Recording> recording, std::int64_t epoch_ns) {
  master::scope::Table table;
  std::vector<std::string> axes;
  for (const api::NamedChannel& channel : recording->plan().channels) {
    const auto known = std::find(axes.begin(), axes.end(), channel.axis);
    table.groups.push_back(static_cast<std::size_t>(known - axes.begin()));
    if (known == axes.end()) axes.push_back(channel.axis);
    table.channels.push_back({.name = field_name(channel.view), .unit = channel.view.value("unit", std::string())});
  }
  for (const std::string& axis : axes) table.topics.push_back("/" + axis);
  table.rows = static_cast<std::size_t>(recording->samples());
  table.source = recording->plan().name;
  table.way = fmt::format("every {} us", static_cast<double>(recording->plan().stride) * drive::tick_seconds * 1e6);
  table.unix_ns = [recording, epoch_ns](std::size_t row, std::size_t) {
    return epoch_ns + recording->tick(static_cast<std::int64_t>(row)) * links::Time(line::tick_length).count();
  };
  table.value = [recording](std::size_t row, std::size_t channel) {
    return recording->value(channel, static_cast<std::int64_t>(row));
  };
  return table;
}

}  // namespace

Json RecordingExport::show_mcap(Call& call) {
  const auto& own = *static_cast<const RecordingExport*>(call.context);
  auto table = table_of(ended_recording(call, own.find_), own.epoch_().count());
  call.content = api::Content{"application/octet-stream", {}, master::scope::mcap_parts_of(std::move(table))};
  return nullptr;
}

api::RouteGroup RecordingExport::routes() {
  static constexpr std::array table{Route{Method::get, "/api/v1/recordings/{}/data.mcap", show_mcap}};
  return {table, this};
}

}  // namespace servodrome::studio
