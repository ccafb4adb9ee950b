#pragma once

#include <algorithm>
#include <cctype>
#include <set>
#include <sstream>

#include "csv.hpp"
#include "products/device.hpp"

// Compares the objects of a manual (tests/data/*_od.csv) with a running drive: type, access, PDO mapping, default,
// range, unit, storage. The test lists differences with their reasons, and the list must not contain entries without a
// difference.
namespace servodrome::test {

inline constexpr int any_sub = -1;
struct Difference {
  std::uint16_t index;
  int sub;
  std::string column;
};

// The list as a file next to the manual's, for products with many differences: index,sub,column,reason.
inline std::vector<Difference> read_differences(const std::string& name) {
  std::vector<Difference> differences;
  for (const CsvRow& row : read_csv(name)) {
    EXPECT_FALSE(row.at("reason").empty()) << row.at("index");
    differences.push_back({static_cast<std::uint16_t>(std::stoul(row.at("index"), nullptr, 16)),
                           static_cast<std::uint8_t>(std::stoul(row.at("sub"), nullptr, 16)), row.at("column")});
  }
  return differences;
}

inline std::string text_of(dictionary::Type type) {
  using dictionary::Type;
  switch (type) {
    case Type::boolean: return "BOOLEAN";
    case Type::integer8: return "INTEGER8";
    case Type::integer16: return "INTEGER16";
    case Type::integer32: return "INTEGER32";
    case Type::unsigned8: return "UNSIGNED8";
    case Type::unsigned16: return "UNSIGNED16";
    case Type::unsigned32: return "UNSIGNED32";
    case Type::integer64: return "INTEGER64";
    case Type::unsigned64: return "UNSIGNED64";
    case Type::domain: return "DOMAIN";
    case Type::visible_string: return "VISIBLE_STRING";
    default: return "other";
  }
}

inline std::string text_of(dictionary::Access access) {
  using dictionary::Access;
  switch (access) {
    case Access::constant: return "const";
    case Access::ro: return "ro";
    case Access::wo: return "wo";
    case Access::rw: return "rw";
  }
  return "";
}

inline std::string text_of(dictionary::Pdo pdo) {
  using dictionary::Pdo;
  switch (pdo) {
    case Pdo::none: return "none";
    case Pdo::rpdo: return "rx";
    case Pdo::tpdo: return "tx";
    case Pdo::both: return "both";
  }
  return "";
}

inline std::string without_spaces(std::string text) {
  std::erase(text, ' ');
  return text;
}

// The manual may describe the origin of a number in words.
inline bool is_number(const std::string& text) {
  return !text.empty() && (std::isdigit(static_cast<unsigned char>(text.front())) != 0 || text.front() == '-');
}

// "0x180+node-ID" for `node`, "0x80000381", "1310720", "-4".
inline std::int64_t csv_number(const std::string& text, std::uint8_t node) {
  const std::size_t plus = text.find('+');
  return std::stoll(text.substr(0, plus), nullptr, 0) + (plus == std::string::npos ? 0 : node);
}

// `number_units` are words of the unit column that describe the format of a number and are not units. Returns the rows.
inline std::size_t compare_objects(const dictionary::Dictionary& dictionary, std::uint8_t node,
                                   const std::vector<CsvRow>& rows, const std::vector<Difference>& differences,
                                   const std::vector<std::string>& number_units = {}) {
  std::vector<bool> used(differences.size());
  for (const CsvRow& row : rows) {
    const auto index = static_cast<std::uint16_t>(std::stoul(row.at("index"), nullptr, 16));
    const auto sub = static_cast<std::uint8_t>(std::stoul(row.at("sub"), nullptr, 16));
    const dictionary::Entry* entry = dictionary.find(index, sub);
    if (entry == nullptr) {
      ADD_FAILURE() << row.at("index") << " " << row.at("sub") << " " << row.at("name") << " is missing";
      continue;
    }
    const auto explained = [&](const std::string& column) {
      bool found = false;
      for (std::size_t i = 0; i < differences.size(); ++i) {
        if (differences[i].index != index || (differences[i].sub != any_sub && differences[i].sub != sub) ||
            column != differences[i].column)
          continue;
        used[i] = true;
        found = true;
      }
      return found;
    };
    const auto compare = [&](const char* column, const std::string& ours) {
      const std::string& theirs = row.at(column);
      if (theirs.empty() || theirs == "unknown" || without_spaces(theirs) == without_spaces(ours)) return;
      if (theirs == "ro" && ours == "const") return;  // a value that is read-only and does not change
      if (explained(column)) return;
      ADD_FAILURE() << std::hex << index << "h:" << int{sub} << " " << column << " is " << ours << ", in the manual "
                    << theirs << " (" << row.at("name") << ")";
    };
    const auto compare_number = [&](const char* column, std::int64_t ours) {
      if (row.at(column).empty()) return;
      const bool same = is_number(row.at(column)) && csv_number(row.at(column), node) == ours;
      compare(column, same ? row.at(column) : std::to_string(ours));
    };
    compare("type", text_of(entry->type));
    compare("access", text_of(entry->access));
    compare("pdo", text_of(entry->pdo));
    compare_number("default", dictionary.default_number(*entry, node));
    const bool constant = entry->access == dictionary::Access::constant;
    compare_number("min", constant ? entry->default_value : entry->minimum);
    compare_number("max", constant ? entry->default_value : entry->maximum);
    const std::string& unit = row.at("unit");
    if (std::find(number_units.begin(), number_units.end(), unit) == number_units.end()) compare("unit", entry->unit);
    compare("saved", entry->saved ? "yes" : "no");
    // The drive's values must be those of the table.
    if (!row.at("default").empty() && entry->writable() && !explained("default")) {
      EXPECT_EQ(dictionary.number(*entry), dictionary.default_number(*entry, node))
          << row.at("index") << " " << row.at("sub");
    }
  }
  for (std::size_t i = 0; i < used.size(); ++i) {
    EXPECT_TRUE(used[i]) << "no difference: " << std::hex << differences[i].index << "h:" << differences[i].sub << " "
                         << differences[i].column;
  }
  return rows.size();
}

// The objects of a drive's table from 2000h on that the manual's file does not list, in the form "6502h:0 6503h:0".
// Lower indices are the communication objects of CiA 301.
template <typename Table>
std::string unlisted_objects(const Table& table, const std::vector<CsvRow>& rows) {
  std::set<std::uint32_t> listed;
  for (const CsvRow& row : rows) {
    listed.insert(static_cast<std::uint32_t>(std::stoul(row.at("index"), nullptr, 16) << 8 |
                                             std::stoul(row.at("sub"), nullptr, 16)));
  }
  std::ostringstream unlisted;
  for (const dictionary::Entry& entry : table) {
    if (entry.index < 0x2000 || listed.contains(entry.key())) continue;
    if (unlisted.tellp() > 0) unlisted << ' ';
    unlisted << std::hex << std::uppercase << entry.index << "h:" << std::dec << int{entry.sub};
  }
  return unlisted.str();
}

}  // namespace servodrome::test
