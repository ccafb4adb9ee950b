#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <toml++/toml.h>
#include <vector>

#include "line/diagnostic.hpp"
#include "line/plant_keys.hpp"

namespace servodrome::line {

// A key that a parser asked for, for the description of a file format.
struct KeyNote {
  enum class Kind : std::uint8_t { string, boolean, number, integer, table, tables };
  std::string key;
  Kind kind = Kind::string;
  std::optional<std::int64_t> minimum{}, maximum{};  // of an integer
  std::vector<std::string> words{};                  // the only values of a string; empty: any
  std::string definition{};                          // name of the description of a table
};

// Collects the errors and warnings about a file.
struct FileReport {
  std::string file;
  std::vector<Diagnostic> diagnostics;
  std::vector<Diagnostic> warnings;
  std::vector<KeyNote>* notes = nullptr;  // if given, gets each key that a parser asks for

  void complain(const toml::source_position& at, std::string what, std::string hint);
  void warn(const toml::source_position& at, std::string what, std::string hint);
};

// Reads one table of a TOML file key by key. `finish` reports each key that no call asked for as unknown. If a value
// has the wrong type or is out of range, `read` reports an error and does not change the target.
class TableReader {
 public:
  // `path` is the table's name in messages ("axis `x`.motor"); it is empty for the root of the file.
  TableReader(const toml::table& table, std::string path, FileReport& report)
      : table_(table), path_(std::move(path)), report_(report) {}

  void read(std::string_view key, std::string& target);
  void read(std::string_view key, bool& target);
  void read(std::string_view key, double& target);
  template <typename Integer>
  requires std::is_integral_v<Integer>
  void read(std::string_view key, Integer& target, std::int64_t minimum = std::numeric_limits<Integer>::min(),
            std::int64_t maximum = static_cast<std::int64_t>(std::numeric_limits<Integer>::max())) {
    if (const auto value = integer(key, minimum, maximum)) target = static_cast<Integer>(*value);
  }
  // Reads a key that may be left out. If the key is there, `target` has a value afterwards, even after an error.
  template <typename Value, typename... Range>
  void read(std::string_view key, std::optional<Value>& target, Range... range) {
    Value value = target.value_or(Value{});
    read(key, value, range...);
    if (table_.get(key) != nullptr) target = value;
  }
  template <typename Struct, std::size_t Count>
  void read(Struct& target, const std::array<Key<Struct>, Count>& keys) {
    for (const Key<Struct>& key : keys) {
      std::visit([&](auto member) { read_member(key.name, target.*member); }, key.member);
    }
  }

  // Returns the node under `key`, or nullptr. Marks the key as known.
  const toml::node* node(std::string_view key);
  // The same for a table. Reports an error if the node is no table. `definition` names the description of the table.
  const toml::table* table(std::string_view key, std::string_view definition = {});
  // Returns the tables of an array of tables ([[key]]); empty if the key is not there.
  std::vector<const toml::table*> tables(std::string_view key, std::string_view definition = {});
  // Notes the only values that the string under `key` may have, for the description of the file format.
  void note_words(std::string_view key, const std::vector<std::string_view>& words);

  // Reports unknown keys. Must be called after all known keys have been read.
  void finish();

  // Reports an error at the value of `key`, or at the table if the key is not there.
  void complain(std::string_view key, std::string what, std::string hint);
  toml::source_position place(std::string_view key) const;
  const std::string& path() const { return path_; }
  std::string name_of(std::string_view key) const;
  FileReport& report() { return report_; }

 private:
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t minimum, std::int64_t maximum);
  void note(KeyNote note);
  void wrong_type(std::string_view key, const toml::node& node, std::string_view expected);

  void read_member(std::string_view key, double& target) { read(key, target); }
  void read_member(std::string_view key, bool& target) { read(key, target); }
  void read_member(std::string_view key, float& target);
  template <typename Integer>
  void read_member(std::string_view key, Integer& target) {
    read(key, target);
  }

  const toml::table& table_;
  std::string path_;
  FileReport& report_;
  std::set<std::string, std::less<>> known_;
};

}  // namespace servodrome::line
