// MCAP 0 (mcap.dev/spec): a container of time-stamped messages that robotics tools read.
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <memory>
#include <utility>

#include "scope/files.hpp"

namespace servodrome::scope {

namespace {

constexpr std::string_view mcap_magic("\x89MCAP0\r\n", 8);
constexpr std::size_t mcap_chunk_bytes = std::size_t{1} << 18;  // written in a few milliseconds

enum class McapRecord : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F,
};

// Serialises to little endian; strings, arrays and maps are preceded by their length in bytes.
class McapBytes {
 public:
  template <typename T>
  McapBytes& number(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      text_ += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xFF);
    }
    return *this;
  }
  McapBytes& string(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    text_ += value;
    return *this;
  }
  McapBytes& raw(std::string_view value) {
    text_ += value;
    return *this;
  }
  McapBytes& record(McapRecord kind, const McapBytes& content) {
    number(static_cast<std::uint8_t>(kind)).number(static_cast<std::uint64_t>(content.text_.size()));
    text_ += content.text_;
    return *this;
  }
  std::size_t size() const { return text_.size(); }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string json_string(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + '"';
}

// JSON cannot represent NaN and infinity, so they become null.
std::string text_of_json(double number) { return std::isfinite(number) ? text_of_number(number) : "null"; }

class McapWriter {
 public:
  explicit McapWriter(Table table) : table_(std::move(table)) {}

  // Returns the next part of the file: a chunk, with the file's header before the first and its summary after the last.
  // "": the file is complete.
  std::string next() {
    if (ended_) return {};
    if (row_ == 0) part_.raw(mcap_magic).record(McapRecord::header, McapBytes().string("").string("servodrome"));
    if (row_ < table_.rows) row_ = write_chunk(row_);
    if (row_ >= table_.rows) {
      part_.record(McapRecord::data_end, McapBytes().number(std::uint32_t{0}));
      write_summary();
      ended_ = true;
    }
    given_ += part_.size();
    return std::exchange(part_, {}).text();
  }

 private:
  struct Chunk {
    std::uint64_t first_ns = 0;
    std::uint64_t last_ns = 0;
    std::size_t at = 0;
    std::size_t bytes = 0;  // size of the whole record
    std::size_t content_bytes = 0;
    std::map<std::uint16_t, std::size_t> index_at{};
    std::size_t index_bytes = 0;
  };

  // Present position in the file.
  std::size_t place() const { return given_ + part_.size(); }

  static std::uint16_t channel_id(std::size_t group) { return static_cast<std::uint16_t>(group + 1); }

  std::vector<const Channel*> members(std::size_t group) const {
    std::vector<const Channel*> found;
    for (std::size_t i = 0; i < table_.channels.size(); ++i) {
      if (table_.groups[i] == group) found.push_back(&table_.channels[i]);
    }
    return found;
  }

  McapBytes schema(std::size_t group) const {
    std::string properties;
    for (const Channel* channel : members(group)) {
      properties += fmt::format("{}{}:{{\"type\":\"number\",\"description\":{}}}", properties.empty() ? "" : ",",
                                json_string(channel->name), json_string(channel->unit));
    }
    McapBytes bytes;
    bytes.number(channel_id(group))
        .string("servodrome" + table_.topics[group])
        .string("jsonschema")
        .string(fmt::format("{{\"type\":\"object\",\"properties\":{{{}}}}}", properties));
    return bytes;
  }
  McapBytes channel(std::size_t group) const {
    McapBytes metadata;
    metadata.string("source").string(table_.source).string("way").string(table_.way);
    McapBytes bytes;
    bytes.number(channel_id(group))
        .number(channel_id(group))
        .string(table_.topics[group])
        .string("json")
        .string(metadata.text());
    return bytes;
  }
  void write_schemas_and_channels(McapBytes& into) const {
    for (std::size_t group = 0; group < table_.topics.size(); ++group) {
      into.record(McapRecord::schema, schema(group)).record(McapRecord::channel, channel(group));
    }
  }

  std::uint64_t time_ns(std::size_t row, std::size_t group) const {
    return static_cast<std::uint64_t>(table_.zero_unix_ns + table_.time(row, group).count());
  }

  std::string message(std::size_t row, std::size_t group) const {
    std::string json = "{";
    for (std::size_t i = 0; i < table_.channels.size(); ++i) {
      if (table_.groups[i] != group) continue;
      json += fmt::format("{}{}:{}", json.size() == 1 ? "" : ",", json_string(table_.channels[i].name),
                          text_of_json(table_.value(row, i)));
    }
    return json + "}";
  }

  // Writes a chunk with as many rows as fit; returns the row after them.
  std::size_t write_chunk(std::size_t row) {
    McapBytes content;
    write_schemas_and_channels(content);
    Chunk chunk{.first_ns = time_ns(row, 0)};
    std::map<std::uint16_t, McapBytes> indexes;
    for (; row < table_.rows && content.size() < mcap_chunk_bytes; ++row) {
      for (std::size_t group = 0; group < table_.topics.size(); ++group) {
        const std::uint64_t at = time_ns(row, group);
        chunk.first_ns = std::min(chunk.first_ns, at);
        chunk.last_ns = std::max(chunk.last_ns, at);
        indexes[channel_id(group)].number(at).number(static_cast<std::uint64_t>(content.size()));
        content.record(McapRecord::message, McapBytes()
                                                .number(channel_id(group))
                                                .number(static_cast<std::uint32_t>(row))
                                                .number(at)
                                                .number(at)
                                                .raw(message(row, group)));
      }
    }
    chunk.at = place();
    chunk.content_bytes = content.size();
    part_.record(McapRecord::chunk, McapBytes()
                                        .number(chunk.first_ns)
                                        .number(chunk.last_ns)
                                        .number(static_cast<std::uint64_t>(content.size()))
                                        .number(std::uint32_t{0})
                                        .string("")
                                        .number(static_cast<std::uint64_t>(content.size()))
                                        .raw(content.text()));
    chunk.bytes = place() - chunk.at;
    for (const auto& [id, entries] : indexes) {
      chunk.index_at[id] = place();
      part_.record(McapRecord::message_index, McapBytes().number(id).string(entries.text()));
    }
    chunk.index_bytes = place() - chunk.at - chunk.bytes;
    chunks_.push_back(chunk);
    return row;
  }

  McapBytes chunk_index(const Chunk& chunk) const {
    McapBytes offsets;
    for (const auto& [id, at] : chunk.index_at) offsets.number(id).number(static_cast<std::uint64_t>(at));
    McapBytes bytes;
    bytes.number(chunk.first_ns)
        .number(chunk.last_ns)
        .number(static_cast<std::uint64_t>(chunk.at))
        .number(static_cast<std::uint64_t>(chunk.bytes))
        .string(offsets.text())
        .number(static_cast<std::uint64_t>(chunk.index_bytes))
        .string("")
        .number(static_cast<std::uint64_t>(chunk.content_bytes))
        .number(static_cast<std::uint64_t>(chunk.content_bytes));
    return bytes;
  }

  McapBytes statistics() const {
    const std::uint64_t rows = table_.rows;
    std::uint64_t first = 0;
    std::uint64_t last = 0;
    if (!chunks_.empty()) {
      first = chunks_.front().first_ns;
      last = chunks_.back().last_ns;
    }
    McapBytes counts;
    for (std::size_t group = 0; group < table_.topics.size(); ++group) counts.number(channel_id(group)).number(rows);
    McapBytes bytes;
    bytes.number(rows * table_.topics.size())
        .number(static_cast<std::uint16_t>(table_.topics.size()))
        .number(static_cast<std::uint32_t>(table_.topics.size()))
        .number(std::uint32_t{0})
        .number(std::uint32_t{0})
        .number(static_cast<std::uint32_t>(chunks_.size()))
        .number(first)
        .number(last)
        .string(counts.text());
    return bytes;
  }

  void write_summary() {
    const std::size_t start = place();
    McapBytes offsets;
    // Writes records of one kind, and notes their offset.
    const auto group = [&](McapRecord kind, const auto& write_records) {
      const std::size_t first = place();
      write_records();
      if (place() == first) return;
      offsets.record(McapRecord::summary_offset, McapBytes()
                                                     .number(static_cast<std::uint8_t>(kind))
                                                     .number(static_cast<std::uint64_t>(first))
                                                     .number(static_cast<std::uint64_t>(place() - first)));
    };
    group(McapRecord::schema, [&] {
      for (std::size_t i = 0; i < table_.topics.size(); ++i) part_.record(McapRecord::schema, schema(i));
    });
    group(McapRecord::channel, [&] {
      for (std::size_t i = 0; i < table_.topics.size(); ++i) part_.record(McapRecord::channel, channel(i));
    });
    group(McapRecord::statistics, [&] { part_.record(McapRecord::statistics, statistics()); });
    group(McapRecord::chunk_index, [&] {
      for (const Chunk& chunk : chunks_) part_.record(McapRecord::chunk_index, chunk_index(chunk));
    });
    const std::size_t offsets_start = place();
    part_.raw(offsets.text());
    part_.record(McapRecord::footer, McapBytes()
                                         .number(static_cast<std::uint64_t>(start))
                                         .number(static_cast<std::uint64_t>(offsets_start))
                                         .number(std::uint32_t{0}));
    part_.raw(mcap_magic);
  }

  Table table_;
  std::size_t row_ = 0;
  bool ended_ = false;
  std::size_t given_ = 0;  // bytes of the parts returned before
  McapBytes part_;
  std::vector<Chunk> chunks_;
};

}  // namespace

std::function<std::string()> mcap_parts_of(Table table) {
  return [writer = std::make_shared<McapWriter>(std::move(table))] { return writer->next(); };
}

std::string mcap_of(const Recording& recording) { return joined(mcap_parts_of(table_of(recording))); }

}  // namespace servodrome::scope
