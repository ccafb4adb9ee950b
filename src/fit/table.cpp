#include "fit/table.hpp"

#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>

#include "fit/error.hpp"
#include "fit/mcap_reader.hpp"

namespace servodrome::fit {

namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();
constexpr const char* what_is_read =
    "give a .csv or .mcap file of `servodrome scope -o`, of the studio or the bench API, or the output of `servodrome "
    "scope --json`";

[[noreturn]] void refuse(const std::string& source, const std::string& happened) {
  throw Error(source, happened, what_is_read);
}

// Takes one line of RFC 4180 (quoted fields; "" is a quote in them) off `text`.
std::vector<std::string> take_record(std::string_view& text) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  std::size_t i = 0;
  for (; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      const bool doubled = c == '"' && i + 1 < text.size() && text[i + 1] == '"';
      if (doubled) ++i;
      if (c == '"' && !doubled) {
        quoted = false;
      } else {
        fields.back() += c;
      }
    } else if (c == '"') {
      quoted = true;
    } else if (c == ',') {
      fields.emplace_back();
    } else if (c == '\n') {
      ++i;
      break;
    } else if (c != '\r') {
      fields.back() += c;
    }
  }
  text.remove_prefix(i);
  return fields;
}

// Parses "NAME [UNIT]"; in a line's recording the axis comes first.
Column column_of(std::string_view head, bool of_line) {
  Column column;
  if (of_line) {
    const std::size_t blank = std::min(head.find(' '), head.size());
    column.axis = head.substr(0, blank);
    head.remove_prefix(std::min(blank + 1, head.size()));
  }
  const std::size_t bracket = head.rfind(" [");
  if (bracket != std::string_view::npos && head.ends_with(']')) {
    column.unit = head.substr(bracket + 2, head.size() - bracket - 3);
    head = head.substr(0, bracket);
  }
  column.name = plain_name(head);
  return column;
}

Table read_csv(std::string_view text, const std::string& source) {
  // Meaning of a field: a time, a value, or the number of a tick, which is ignored.
  struct Place {
    enum class Kind : std::uint8_t { tick, time, value } kind;
    std::size_t index;
  };
  Table table{.source = source, .clocks = {}, .columns = {}};
  std::vector<Place> places;
  const std::vector<std::string> head = take_record(text);
  bool of_line = false;
  for (const std::string& name : head) {
    if (name == "tick" && places.empty()) {
      places.push_back({Place::Kind::tick, 0});
    } else if (name == "seconds" || name == "time_s" || name.starts_with("seconds_")) {
      of_line = name == "time_s";
      places.push_back({Place::Kind::time, table.clocks.size()});
      table.clocks.emplace_back();
    } else {
      if (table.clocks.empty())
        refuse(source, "this is not a recording: no column \"seconds\" or \"time_s\" comes first");
      places.push_back({Place::Kind::value, table.columns.size()});
      table.columns.push_back(column_of(name, of_line));
      table.columns.back().clock = table.clocks.size() - 1;
    }
  }
  if (table.columns.empty()) refuse(source, "this is not a recording: its first line names no channel");
  for (std::size_t line = 2; !text.empty(); ++line) {
    const std::vector<std::string> fields = take_record(text);
    if (fields.size() == 1 && fields.front().empty()) continue;
    if (fields.size() != places.size()) {
      throw Error(fmt::format("{}:{}", source, line),
                  fmt::format("{} fields, the first line has {}", fields.size(), places.size()),
                  "the file is damaged or cut off: record again, or remove the line");
    }
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (places[i].kind == Place::Kind::tick) continue;
      double value = no_value;
      const std::string& field = fields[i];
      const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
      const bool is_number = error == std::errc() && end == field.data() + field.size();
      const bool is_time = places[i].kind == Place::Kind::time;
      if ((!is_number && !field.empty()) || (is_time && !(std::abs(value) < 1e12))) {
        throw Error(fmt::format("{}:{}", source, line),
                    fmt::format("\"{}\" in column {} is not a number", field.substr(0, 40), i + 1),
                    "the file is damaged: record again, or remove the line");
      }
      (is_time ? table.clocks[places[i].index] : table.columns[places[i].index].values).push_back(value);
    }
  }
  return table;
}

double number_of(const nlohmann::json& json) { return json.is_number() ? json.get<double>() : no_value; }

Table read_json(std::string_view text, const std::string& source) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("channels") || !json["channels"].is_array()) {
    refuse(source, "this JSON is not a recording");
  }
  Table table{.source = source, .clocks = {}, .columns = {}};
  for (const nlohmann::json& channel : json["channels"]) {
    const bool has_samples = channel.is_object() && channel.value("seconds", nlohmann::json()).is_array() &&
                             channel.value("values", nlohmann::json()).is_array() &&
                             channel["seconds"].size() == channel["values"].size();
    if (!has_samples) {
      throw Error(source, "this JSON has no samples",
                  "omit `-o` so that `scope --json` prints them, or give the file that -o has written");
    }
    const auto word = [&](const char* key) {
      const auto at = channel.find(key);
      return at != channel.end() && at->is_string() ? at->get<std::string>() : std::string();
    };
    std::vector<double> seconds;
    for (const nlohmann::json& time : channel["seconds"]) seconds.push_back(number_of(time));
    std::size_t clock = 0;
    while (clock < table.clocks.size() && table.clocks[clock] != seconds) ++clock;
    if (clock == table.clocks.size()) table.clocks.push_back(std::move(seconds));
    Column column{.axis = {}, .name = plain_name(word("name")), .unit = word("unit"), .clock = clock, .values = {}};
    for (const nlohmann::json& value : channel["values"]) column.values.push_back(number_of(value));
    table.columns.push_back(std::move(column));
  }
  return table;
}

}  // namespace

std::string plain_name(std::string_view text) {
  // "6064:00 Position actual value"
  const std::size_t colon = text.find(':');
  if (colon == 4 && text.size() > 8 && text[7] == ' ') text.remove_prefix(8);
  std::string name;
  for (const char c : text) {
    const bool is_upper = c >= 'A' && c <= 'Z';
    if (is_upper || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')) {
      name += is_upper ? static_cast<char>(c - 'A' + 'a') : c;
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name;
}

Table read_table(std::string_view bytes, const std::string& source) {
  Table table;
  if (bytes.starts_with(mcap_magic)) {
    table = read_mcap(bytes, source);
  } else {
    if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
    const std::size_t first = std::min(bytes.find_first_not_of(" \t\r\n"), bytes.size());
    if (first == bytes.size()) refuse(source, "the file is empty");
    if (bytes[first] == '<') refuse(source, "this is a picture or a page, which has no samples");
    if (bytes.find('\0') != std::string_view::npos) refuse(source, "this is neither a text file nor an MCAP file");
    table = bytes[first] == '{' ? read_json(bytes, source) : read_csv(bytes, source);
  }
  for (const std::vector<double>& clock : table.clocks) {
    for (std::size_t i = 1; i < clock.size(); ++i) {
      if (clock[i] > clock[i - 1]) continue;
      throw Error(source, fmt::format("time stands still or goes back at sample {} ({:g} s)", i + 1, clock[i]),
                  "the file is damaged: record again");
    }
  }
  return table;
}

}  // namespace servodrome::fit
