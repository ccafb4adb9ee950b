#include <algorithm>
#include <gtest/gtest.h>
#include <sstream>

#include "csv.hpp"
#include "products/ismc/ismc.hpp"
#include "rig.hpp"

// Every object of the ISMC manual (tests/data/ismc_od.csv) against the running drive: type, access, PDO mapping,
// default, range, unit. What differs is listed with its reason, and the list may hold nothing that does not differ.
namespace servodrome {
namespace {

using dictionary::Access;
using dictionary::Entry;
using dictionary::Pdo;
using dictionary::Type;
using products::Ismc;
using test::CsvRow;

struct Difference {
  std::uint16_t index;
  const char* column;
};

std::string type_text(Type type) {
  switch (type) {
    case Type::boolean: return "BOOLEAN";
    case Type::integer8: return "INTEGER8";
    case Type::integer16: return "INTEGER16";
    case Type::integer32: return "INTEGER32";
    case Type::unsigned8: return "UNSIGNED8";
    case Type::unsigned16: return "UNSIGNED16";
    case Type::unsigned32: return "UNSIGNED32";
    default: return "other";
  }
}

std::string access_text(Access access) {
  switch (access) {
    case Access::constant: return "const";
    case Access::ro: return "ro";
    case Access::wo: return "wo";
    case Access::rw: return "rw";
  }
  return "";
}

std::string pdo_text(Pdo pdo) {
  switch (pdo) {
    case Pdo::none: return "none";
    case Pdo::rpdo: return "rx";
    case Pdo::tpdo: return "tx";
    case Pdo::both: return "both";
  }
  return "";
}

// "0x180+NodeID" for node 1, "0x80000381", "1310720".
std::int64_t number(const std::string& text) {
  const std::size_t plus = text.find("+NodeID");
  return std::stoll(text.substr(0, plus), nullptr, 0) + (plus == std::string::npos ? 0 : 1);
}

const std::vector<Difference> differences{
    // The error register may be mapped by CiA 301.
    {0x1001, "pdo"},
    // Bits 15 to 0 alone are milliseconds.
    {0x1016, "unit"},
    // PDO 3 and 4 are invalid from the factory (L689, G7).
    {0x1402, "default"},
    {0x1403, "default"},
    {0x1802, "default"},
    {0x1803, "default"},
    // More than eight objects are refused by the node, with 0604 0042h where they are too long.
    {0x1600, "max"},
    {0x1601, "max"},
    {0x1602, "max"},
    {0x1603, "max"},
    {0x1A00, "max"},
    {0x1A01, "max"},
    {0x1A02, "max"},
    {0x1A03, "max"},
    // Values between the ends are missing, so the drive itself refuses what is not there, with 0609 0030h (G13, G14).
    {0x605A, "min"},
    {0x605A, "max"},
    {0x605B, "min"},
    {0x605B, "max"},
    {0x605C, "min"},
    {0x605C, "max"},
    {0x605D, "min"},
    {0x605D, "max"},
    {0x605E, "min"},
    {0x605E, "max"},
    {0x6060, "min"},
    {0x6060, "max"},
    {0x6061, "min"},
    {0x6061, "max"},
    // Accepted, and a fault when a motion is planned: 6285h, 6286h, 6287h, 6553h (G39b).
    {0x2117, "min"},
    {0x2117, "max"},
    {0x6086, "min"},
    {0x6086, "max"},
    {0x6088, "min"},
    {0x6088, "max"},
    {0x60C2, "min"},
    // The manual's mapping column is incomplete: all process data may be mapped (G44).
    {0x6062, "pdo"},
    {0x6063, "pdo"},
    {0x6069, "pdo"},
    {0x606B, "pdo"},
    {0x6074, "pdo"},
    {0x6077, "pdo"},
    {0x6083, "pdo"},
    {0x6084, "pdo"},
    {0x6087, "pdo"},
    {0x60B0, "pdo"},
    {0x60B1, "pdo"},
    {0x60B2, "pdo"},
    {0x60B8, "pdo"},
    {0x60B9, "pdo"},
    {0x60BA, "pdo"},
    {0x60FC, "pdo"},
    {0x60FD, "pdo"},
    {0x60FE, "pdo"},
};

bool explained(std::uint16_t index, const std::string& column, std::vector<bool>& used) {
  bool found = false;
  for (std::size_t i = 0; i < differences.size(); ++i) {
    if (differences[i].index != index || column != differences[i].column) continue;
    used[i] = true;
    found = true;
  }
  return found;
}

std::string without_spaces(std::string text) {
  text.erase(std::remove(text.begin(), text.end(), ' '), text.end());
  return text;
}

TEST(IsmcObjects, AreThoseOfTheManual) {
  test::Rig<Ismc> rig;
  std::vector<bool> used(differences.size());
  std::size_t rows = 0;
  for (const CsvRow& row : test::read_csv("ismc_od.csv")) {
    ++rows;
    const auto index = static_cast<std::uint16_t>(std::stoul(row.at("index"), nullptr, 16));
    const auto sub = static_cast<std::uint8_t>(std::stoul(row.at("sub"), nullptr, 16));
    const Entry* entry = rig.device.dictionary().find(index, sub);
    if (entry == nullptr) {
      ADD_FAILURE() << row.at("index") << " " << row.at("sub") << " " << row.at("name") << " is missing";
      continue;
    }
    const auto compare = [&](const char* column, const std::string& ours) {
      const std::string& theirs = row.at(column);
      if (theirs.empty() || theirs == "unknown" || without_spaces(theirs) == without_spaces(ours)) return;
      if (theirs == "ro" && ours == "const") return;  // what cannot be written and does not change
      if (explained(index, column, used)) return;
      ADD_FAILURE() << std::hex << index << "h:" << int{sub} << " " << column << " is " << ours << ", in the manual "
                    << theirs << " (" << row.at("name") << ")";
    };
    const auto compare_number = [&](const char* column, std::int64_t ours) {
      if (row.at(column).empty()) return;
      compare(column, number(row.at(column)) == ours ? row.at(column) : std::to_string(ours));
    };
    compare("type", type_text(entry->type));
    compare("access", access_text(entry->access));
    compare("pdo", pdo_text(entry->pdo));
    compare_number("default", rig.device.dictionary().default_number(*entry, 1));
    const bool constant = entry->access == Access::constant;
    compare_number("min", constant ? entry->default_value : entry->minimum);
    compare_number("max", constant ? entry->default_value : entry->maximum);
    compare("unit", entry->unit);
    if (row.at("saved") == "yes") {
      EXPECT_TRUE(entry->saved) << row.at("index");
    }
    // What the table says is what the drive does.
    const std::int64_t value = rig.device.dictionary().number(*entry);
    if (!row.at("default").empty() && entry->writable()) {
      EXPECT_EQ(value, rig.device.dictionary().default_number(*entry, 1)) << row.at("index") << " " << row.at("sub");
    }
  }
  EXPECT_EQ(rows, 204U);
  for (std::size_t i = 0; i < used.size(); ++i) {
    EXPECT_TRUE(used[i]) << "no difference: " << std::hex << differences[i].index << " " << differences[i].column;
  }
}

// Every object that may be written takes its limits, and nothing beyond them.
TEST(IsmcObjects, RangesHoldAtTheirEnds) {
  test::Rig<Ismc> rig;
  rig.run_ms(1);
  for (const Entry& entry : Ismc::table) {
    if (entry.index < 0x2000 || !entry.writable() || !entry.has_range) continue;
    SCOPED_TRACE(testing::Message() << std::hex << entry.index << "h:" << int{entry.sub});
    using dictionary::AbortCode;
    if (entry.maximum < dictionary::maximum_of(entry.type)) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, entry.maximum + 1), AbortCode::value_too_high);
    }
    if (entry.minimum > dictionary::minimum_of(entry.type)) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, entry.minimum - 1), AbortCode::value_too_low);
    }
    if (entry.index == 0x2401) continue;  // needs a store: below
    for (const std::int64_t value : {entry.minimum, entry.maximum}) {
      EXPECT_EQ(rig.set(entry.index, entry.sub, value), AbortCode::none) << value;
      EXPECT_EQ(rig.get(entry.index, entry.sub), value);
    }
  }
}

TEST(IsmcObjects, ModesAndBitRatesThatAreNotThere) {
  using dictionary::AbortCode;
  test::Rig<Ismc> rig;
  rig.run_ms(1);
  for (int mode = -128; mode < 128; ++mode) {  // L305, L1040, G14
    const bool there = mode == 0 || mode == 1 || mode == 3 || mode == 4 || mode == 6 || mode == 8;
    EXPECT_EQ(rig.set(0x6060, 0, mode), there ? AbortCode::none : AbortCode::value_invalid) << mode;
  }
  EXPECT_EQ(rig.get(0x6502), 0xAD);
  for (const int rate : {1000000, 800000, 500000, 250000, 125000, 50000, 20000}) {
    EXPECT_NE(rig.set(0x2004, 0, rate), AbortCode::value_invalid) << rate;
  }
  EXPECT_EQ(rig.set(0x2004, 0, 100000), AbortCode::value_invalid);
  EXPECT_EQ(rig.set(0x2004, 0, 999999), AbortCode::value_invalid);
}

}  // namespace
}  // namespace servodrome
