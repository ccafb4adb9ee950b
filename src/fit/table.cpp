#include "fit/table.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "fit/error.hpp"
#include "fit/mcap_reader.hpp"

namespace servodrome::fit {

namespace {

constexpr double greatest_time_s = 1e12;
constexpr double no_value = std::numeric_limits<double>::quiet_NaN();
constexpr const char* what_is_read =
    "give a .csv or .mcap file of `servodrome scope -o`, of the studio or the bench API, or the output of `servodrome "
    "scope --json`";

[[noreturn]] void refuse(const std::string& source, const std::string& happened) {
  throw Error(source, happened, what_is_read);
}

[[noreturn]] void refuse_columns(const std::string& source) {
  throw Error(source, fmt::format("it has more than {} columns", most_columns), "record fewer channels at once");
}

// Removes one record of RFC 4180 (quoted fields; "" is a quote in them) from the start of `text`; returns its fields.
std::vector<std::string> take_record(std::string_view& text, const std::string& source) {
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
      if (fields.size() == most_columns) refuse_columns(source);
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
  const std::vector<std::string> head = take_record(text, source);
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
    const std::vector<std::string> fields = take_record(text, source);
    if (fields.size() == 1 && fields.front().empty()) continue;
    if (fields.size() != places.size()) {
      throw Error(fmt::format("{}:{}", source, line),
                  fmt::format("{} fields, the first line has {}", fields.size(), places.size()),
                  "the file is damaged or cut off: record again, or remove the line");
    }
    if (line > most_values / places.size()) {
      throw Error(fmt::format("{}:{}", source, line), fmt::format("it has more than {} values", most_values),
                  "record for a shorter time or fewer channels");
    }
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (places[i].kind == Place::Kind::tick) continue;
      double value = no_value;
      const std::string& field = fields[i];
      const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
      const bool is_number = error == std::errc() && end == field.data() + field.size();
      const bool is_time = places[i].kind == Place::Kind::time;
      const bool is_refused = is_time ? !(std::abs(value) < greatest_time_s) : std::isinf(value);
      if ((!is_number && !field.empty()) || is_refused) {
        throw Error(fmt::format("{}:{}", source, line),
                    fmt::format("\"{}\" in column {} is not a number", field.substr(0, 40), i + 1),
                    "the file is damaged: record again, or remove the line");
      }
      (is_time ? table.clocks[places[i].index] : table.columns[places[i].index].values).push_back(value);
    }
  }
  return table;
}

using Json = nlohmann::json;

// Parses the document. A recording consists of numbers. Other JSON elements need more memory, so their number has a
// limit; a document with more is refused.
Json json_of(std::string_view text, const std::string& source) {
  constexpr std::size_t most_bytes = std::size_t{64} << 20;
  constexpr std::ptrdiff_t most_other = 400'000;
  if (text.size() > most_bytes) {
    throw Error(source, fmt::format("this JSON is longer than {} MiB", most_bytes >> 20),
                "record to a .csv or .mcap file with `servodrome scope -o`");
  }
  const auto is_other = [](char c) { return c == '{' || c == '[' || c == '"'; };
  if (std::count_if(text.begin(), text.end(), is_other) > most_other) {
    refuse(source, "this JSON is not a recording: most of it is not numbers");
  }
  try {
    return Json::parse(text);
  } catch (const Json::parse_error& error) {
    throw Error(source, fmt::format("this JSON is not a recording: it cannot be read at byte {}", error.byte),
                std::string(what_is_read) + "; a missing value is null, not NaN");
  } catch (const Json::exception&) {
    throw Error(source, "this JSON has a number that is too large", what_is_read);
  }
}

// The numbers of a channel's array; NaN for a missing one. `what`: "time" or "value", for messages.
std::vector<double> numbers_of(const Json& array, const char* what, bool may_be_missing, const std::string& where) {
  std::vector<double> numbers;
  numbers.reserve(array.size());
  for (const Json& element : array) {
    if (!element.is_number() && !(may_be_missing && element.is_null())) {
      throw Error(where,
                  fmt::format("{} {} is {}, which is not a number", what, numbers.size() + 1,
                              element.dump(-1, ' ', false, Json::error_handler_t::replace).substr(0, 40)),
                  may_be_missing ? "write numbers without quotes, and null for a missing value"
                                 : "write numbers without quotes");
    }
    numbers.push_back(element.is_number() ? element.get<double>() : no_value);
  }
  return numbers;
}

Table read_json(std::string_view text, const std::string& source) {
  Json json = json_of(text, source);
  if (!json.is_object() || !json.contains("channels") || !json["channels"].is_array()) {
    refuse(source, "this JSON is not a recording");
  }
  Table table{.source = source, .clocks = {}, .columns = {}};
  // Channels with the same times share a clock.
  const auto before = [&table](std::size_t one, std::size_t other) { return table.clocks[one] < table.clocks[other]; };
  std::set<std::size_t, decltype(before)> known(before);
  for (Json& channel : json["channels"]) {
    if (table.columns.size() == most_columns) refuse_columns(source);
    const auto word = [&](const char* key) {
      const auto at = channel.find(key);
      return at != channel.end() && at->is_string() ? at->get<std::string>() : std::string();
    };
    const std::string where = word("name").empty()
                                  ? fmt::format("{}: channel {}", source, table.columns.size() + 1)
                                  : fmt::format("{}: channel \"{}\"", source, word("name").substr(0, 60));
    const auto has = [&](const char* key) { return channel.contains(key) && channel[key].is_array(); };
    if (!has("seconds") || !has("values")) {
      throw Error(source, "this JSON has no samples",
                  "omit `-o` so that `scope --json` prints them, or give the file that -o has written");
    }
    if (channel["seconds"].size() != channel["values"].size()) {
      throw Error(where,
                  fmt::format("{} times, but {} value{}", channel["seconds"].size(), channel["values"].size(),
                              channel["values"].size() == 1 ? "" : "s"),
                  "the file is damaged: record again");
    }
    table.clocks.push_back(numbers_of(channel["seconds"], "time", false, where));
    const auto [clock, is_new] = known.insert(table.clocks.size() - 1);
    if (!is_new) table.clocks.pop_back();
    table.columns.push_back({.axis = {},
                             .name = plain_name(word("name")),
                             .unit = word("unit"),
                             .clock = *clock,
                             .values = numbers_of(channel["values"], "value", true, where)});
    channel = nullptr;  // frees the memory
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
  if (table.columns.empty()) refuse(source, "this recording has no channel");
  for (const std::vector<double>& clock : table.clocks) {
    for (std::size_t i = 0; i < clock.size(); ++i) {
      if (!(std::abs(clock[i]) < greatest_time_s)) {
        throw Error(source, fmt::format("the time of sample {} is {:g} s", i + 1, clock[i]),
                    "the file is damaged: record again");
      }
      if (i == 0 || clock[i] > clock[i - 1]) continue;
      throw Error(source, fmt::format("time stands still or goes back at sample {} ({:g} s)", i + 1, clock[i]),
                  "the file is damaged: record again");
    }
  }
  return table;
}

}  // namespace servodrome::fit
