#include "studio/project/recording_files.hpp"

#include <algorithm>
#include <charconv>
#include <fmt/format.h>
#include <limits>

#include "api/scope/recording_files.hpp"
#include "links/number_text.hpp"
#include "scope/files.hpp"
#include "studio/project/files.hpp"

namespace servodrome::studio {
namespace {

using nlohmann::json;

constexpr const char* hint = "correct the file, take it from git, or delete both files of the recording";
constexpr std::int64_t latest_tick = std::int64_t{1} << 53;
constexpr std::int64_t longest_stride = 1'000'000;

std::string string_in(const json& object, const char* key) { return object.at(key).get<std::string>(); }

api::NamedChannel channel_of(const json& view) {
  for (const char* key : {"name", "unit", view.contains("object") ? "object" : "signal"}) string_in(view, key);
  return {string_in(view, "axis"), api::Json(view), {}, {}};
}

// Reads all but the samples.
std::pair<api::Recording::Plan, api::Recording::Kept> read_about(const std::filesystem::path& file, std::uint32_t id) {
  const json view = parse_json(read_file(file).value_or(""), file);
  api::Recording::Plan plan;
  api::Recording::Kept kept;
  try {
    plan.id = id;
    plan.name = string_in(view, "name");
    plan.note = string_in(view, "note");
    plan.stride = view.at("stride").get<std::int64_t>();
    plan.samples = view.at("samples").get<std::int64_t>();
    for (const json& channel : view.at("channels")) plan.channels.push_back(channel_of(channel));
    kept.is_stopped = string_in(view, "state") == "stopped";
    kept.first_tick = view.at("first_tick").get<std::int64_t>();
    if (!view.at("trigger_tick").is_null()) kept.trigger_tick = view["trigger_tick"].get<std::int64_t>();
    if (view.contains("fault")) {
      const std::string code = string_in(view["fault"], "code").substr(2);  // behind "0x"
      kept.fault = api::Recording::Fault{string_in(view["fault"], "axis"),
                                         links::number_of_text<unsigned>(code, 16).value_or(0)};
    }
  } catch (const json::exception& error) {
    const std::string_view what = error.what();
    throw ProjectError(
        file, fmt::format("a key is missing or has the wrong type: {}", what.substr(what.find("] ") + 2)), hint);
  } catch (const std::out_of_range&) {
    throw ProjectError(file, "the code of the fault is not like 0x1234", hint);
  }
  const auto most_values = static_cast<std::int64_t>(api::Recordings::largest_bytes / sizeof(double));
  const auto channels = static_cast<std::int64_t>(plan.channels.size());
  const auto is_outside = [](std::int64_t value, std::int64_t least, std::int64_t most) {
    return value < least || value > most;
  };
  if (channels < 1 || is_outside(plan.stride, 1, longest_stride) ||
      is_outside(plan.samples, 1, most_values / channels) || is_outside(kept.first_tick, 0, latest_tick)) {
    throw ProjectError(file, "stride, samples, first_tick or channels are out of range", hint);
  }
  return {std::move(plan), std::move(kept)};
}

// The values of the first channel, then those of the second, and so on.
std::vector<double> read_samples(const std::filesystem::path& file, const api::Recording::Plan& plan) {
  const std::string text = read_file(file).value_or("");
  const auto rows = static_cast<std::size_t>(plan.samples);
  const std::size_t columns = plan.channels.size() + 2;  // two for the time
  std::vector<double> values(rows * plan.channels.size());
  std::size_t at = text.find('\n') + 1;  // behind the head; 0: there is none
  for (std::size_t row = 0; row < rows; ++row) {
    const auto line = static_cast<std::uint32_t>(row + 2);
    const std::size_t end = at == 0 ? std::string::npos : text.find('\n', at);
    if (end == std::string::npos) {
      throw ProjectError(file, fmt::format("it has fewer than {} samples", rows), hint, line, 1);
    }
    std::string_view rest(text.data() + at, end - at);
    if (rest.ends_with('\r')) rest.remove_suffix(1);
    for (std::size_t column = 0; column < columns; ++column) {
      const std::size_t comma = rest.find(',');
      const std::string_view field = rest.substr(0, comma);
      const bool is_last = column + 1 == columns;
      double value = std::numeric_limits<double>::quiet_NaN();
      const auto read = std::from_chars(field.data(), field.data() + field.size(), value);
      const bool is_wrong = !field.empty() && (read.ec != std::errc{} || read.ptr != field.data() + field.size());
      if (is_wrong || is_last != (comma == std::string_view::npos)) {
        throw ProjectError(file, "this is no number, or the row has not one field for each channel", hint, line,
                           static_cast<std::uint32_t>(field.data() - (text.data() + at) + 1));
      }
      if (column >= 2) values[(column - 2) * rows + row] = value;
      if (!is_last) rest.remove_prefix(comma + 1);
    }
    at = end + 1;
  }
  return values;
}

}  // namespace

void load_recordings(const std::filesystem::path& folder, api::Recordings& recordings) {
  const auto ids_of = [&folder](const char* extension) {  // the greatest first
    std::vector<std::uint32_t> ids;
    for (const std::string& name : names_in(folder, extension)) {
      const auto id = links::number_of_text<std::uint32_t>(name, 10);
      if (!id || std::to_string(*id) != name) {
        throw ProjectError(folder / (name + extension), "its name is not the number of a recording",
                           "rename it, or move it to another place");
      }
      ids.push_back(*id);
    }
    std::sort(ids.begin(), ids.end(), std::greater<>());
    return ids;
  };
  const std::vector<std::uint32_t> ids = ids_of(".json");
  // Samples without a description, for example of an incomplete copy, are kept: no new recording takes their name.
  for (const auto& each : {ids, ids_of(".csv")}) {
    if (!each.empty()) recordings.begin_after(each.front());
  }
  std::vector<std::shared_ptr<api::Recording>> loaded;  // newest first
  std::size_t bytes = 0;
  for (const std::uint32_t id : ids) {
    auto [plan, kept] = read_about(folder / fmt::format("{}.json", id), id);
    bytes += static_cast<std::size_t>(plan.samples) * plan.channels.size() * sizeof(double);
    if (bytes > api::Recordings::most_bytes || loaded.size() == api::Recordings::most) break;
    kept.values = read_samples(folder / fmt::format("{}.csv", id), plan);
    loaded.push_back(std::make_shared<api::Recording>(std::move(plan), std::move(kept)));
  }
  for (auto one = loaded.rbegin(); one != loaded.rend(); ++one) recordings.restore(*one);
}

std::string about_text(const api::Recording& recording) {
  api::Json view = recording.view();
  for (const char* left_out : {"id", "bytes", "samples_wanted"}) view.erase(left_out);
  return file_text(view);
}

std::string samples_text(std::shared_ptr<const api::Recording> recording) {
  return scope::joined(api::csv_parts_of(std::move(recording), "\n"));
}

}  // namespace servodrome::studio
