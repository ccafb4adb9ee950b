#include "fit/mcap_reader.hpp"

#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "fit/error.hpp"

namespace servodrome::fit {

namespace {

// Reads numbers (little endian), strings and records; refuses a read beyond the end.
class Reader {
 public:
  Reader(std::string_view bytes, std::size_t place, const std::string& source)
      : bytes_(bytes), place_(place), source_(source) {}

  bool empty() const { return bytes_.empty(); }
  template <typename T>
  T number() {
    const std::string_view raw = take(sizeof(T));
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      value |= std::uint64_t{static_cast<unsigned char>(raw[i])} << (8 * i);
    }
    return static_cast<T>(value);
  }
  std::string_view string() { return take(number<std::uint32_t>()); }
  std::string_view rest() { return take(bytes_.size()); }
  // A reader for the next `size` bytes.
  Reader part(std::uint64_t size) {
    const std::size_t at = place_;
    return {take(size), at, source_};
  }
  [[noreturn]] void refuse(const std::string& happened) const {
    throw Error(fmt::format("{}, byte {}", source_, place_), happened,
                "give an MCAP file of `servodrome scope` or of the bench API, or record again");
  }

 private:
  std::string_view take(std::uint64_t size) {
    if (size > bytes_.size()) refuse("the MCAP file is cut off or damaged");
    const std::string_view taken = bytes_.substr(0, static_cast<std::size_t>(size));
    bytes_.remove_prefix(taken.size());
    place_ += taken.size();
    return taken;
  }

  std::string_view bytes_;
  std::size_t place_;
  std::string source_;
};

class McapTable {
 public:
  explicit McapTable(const std::string& source) { table_.source = source; }

  void read(Reader& reader, bool in_chunk = false) {
    while (!reader.empty()) {
      const auto kind = reader.number<std::uint8_t>();
      Reader record = reader.part(reader.number<std::uint64_t>());
      switch (kind) {
        case 0x03: read_schema(record); break;
        case 0x04: read_channel(record); break;
        case 0x05: read_message(record); break;
        case 0x06:
          if (in_chunk) record.refuse("a chunk of this MCAP file is in another one");
          read_chunk(record);
          break;
        case 0x0F: return;  // end of the data section; an index follows
        default: break;
      }
    }
  }

  Table table() && { return std::move(table_); }

 private:
  struct Topic {
    std::string axis;
    std::size_t clock;
    std::map<std::string, std::size_t> columns;  // by their name in the message
    unsigned schema;
  };
  using Units = std::map<std::string, std::string>;  // by the name in the message

  void read_chunk(Reader& record) {
    record.number<std::uint64_t>();  // skip first and last time, size, checksum
    record.number<std::uint64_t>();
    record.number<std::uint64_t>();
    record.number<std::uint32_t>();
    if (!record.string().empty()) record.refuse("the chunks of this MCAP file are compressed");
    Reader content = record.part(record.number<std::uint64_t>());
    read(content, true);
  }

  void read_schema(Reader& record) {
    const auto id = record.number<std::uint16_t>();
    record.string();
    record.string();
    const auto json = parsed(record, record.string());
    Units& units = units_[id];
    if (!json.is_object() || !json.contains("properties") || !json["properties"].is_object()) return;
    for (const auto& [name, property] : json["properties"].items()) {
      const auto description = property.is_object() ? property.find("description") : property.end();
      if (description != property.end() && description->is_string()) units[name] = description->get<std::string>();
    }
  }

  // Parses a text; the result is_discarded() if the text is no JSON. A text above `most_bytes` has more than
  // `most_columns` values.
  static nlohmann::json parsed(Reader& record, std::string_view text) {
    constexpr std::size_t most_bytes = std::size_t{1} << 20;
    if (text.size() > most_bytes) record.refuse("a message or schema of this MCAP file is longer than 1 MiB");
    return nlohmann::json::parse(text, nullptr, false);
  }

  void read_channel(Reader& record) {
    const auto id = record.number<std::uint16_t>();
    const auto schema = record.number<std::uint16_t>();
    const std::string_view topic = record.string();
    if (record.string() != "json") record.refuse("the messages of this MCAP file are not JSON");
    if (topics_.contains(id)) return;  // each chunk repeats it
    const bool of_scope = topic.starts_with("/scope");
    topics_.emplace(id, Topic{.axis = std::string(of_scope ? "" : topic.substr(topic.empty() ? 0 : 1)),
                              .clock = table_.clocks.size(),
                              .columns = {},
                              .schema = schema});
    table_.clocks.emplace_back();
  }

  void read_message(Reader& record) {
    const auto found = topics_.find(record.number<std::uint16_t>());
    record.number<std::uint32_t>();
    const auto log_ns = record.number<std::uint64_t>();
    record.number<std::uint64_t>();
    const auto json = parsed(record, record.rest());
    if (found == topics_.end() || !json.is_object()) record.refuse("a message of this MCAP file cannot be read");
    Topic& topic = found->second;
    if (!first_ns_) first_ns_ = log_ns;
    std::vector<double>& clock = table_.clocks[topic.clock];
    for (const auto& [name, value] : json.items()) {
      const auto [place, is_new] = topic.columns.try_emplace(name, table_.columns.size());
      if (is_new) {
        if (table_.columns.size() == most_columns) {
          record.refuse(fmt::format("the MCAP file has more than {} columns", most_columns));
        }
        values_ += clock.size();
        table_.columns.push_back({topic.axis, plain_name(name), units_[topic.schema][name], topic.clock,
                                  std::vector<double>(clock.size(), std::numeric_limits<double>::quiet_NaN())});
      }
      std::vector<double>& values = table_.columns[place->second].values;
      values.resize(clock.size(), std::numeric_limits<double>::quiet_NaN());
      if (!value.is_number() && !value.is_null()) {
        record.refuse(fmt::format("\"{}\" in a message is not a number", name.substr(0, 60)));
      }
      values.push_back(value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN());
    }
    values_ += topic.columns.size() + 1;
    if (values_ > most_values) record.refuse(fmt::format("the MCAP file has more than {} values", most_values));
    clock.push_back(static_cast<double>(static_cast<std::int64_t>(log_ns - *first_ns_)) * 1e-9);
  }

  Table table_;
  std::map<unsigned, Units> units_;
  std::size_t values_ = 0;  // in the table, with the times
  std::map<unsigned, Topic> topics_;
  std::optional<std::uint64_t> first_ns_;
};

}  // namespace

Table read_mcap(std::string_view bytes, const std::string& source) {
  Reader reader(bytes.substr(mcap_magic.size()), mcap_magic.size(), source);
  McapTable reading(source);
  reading.read(reader);
  Table table = std::move(reading).table();
  for (Column& column : table.columns) {
    column.values.resize(table.clocks[column.clock].size(), std::numeric_limits<double>::quiet_NaN());
  }
  return table;
}

}  // namespace servodrome::fit
