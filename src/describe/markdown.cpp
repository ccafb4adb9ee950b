#include <fmt/format.h>

#include "describe/description.hpp"
#include "describe/words.hpp"

namespace servodrome::describe {
namespace {

using dictionary::Entry;

struct Group {
  std::uint16_t first;
  std::uint16_t last;
  const char* title;
};

// The parts of a dictionary (CiA 301 table 43 and 7.5.2).
constexpr std::array groups{
    Group{0x0001, 0x0FFF, "Data types"},
    Group{0x1000, 0x11FF, "General communication objects"},
    Group{0x1200, 0x13FF, "SDO parameters"},
    Group{0x1400, 0x15FF, "RPDO communication parameters"},
    Group{0x1600, 0x17FF, "RPDO mapping parameters"},
    Group{0x1800, 0x19FF, "TPDO communication parameters"},
    Group{0x1A00, 0x1BFF, "TPDO mapping parameters"},
    Group{0x1C00, 0x1FFF, "Other communication objects"},
    Group{0x2000, 0x5FFF, "Manufacturer-specific objects"},
    Group{0x6000, 0x9FFF, "Device profile objects"},
    Group{0xA000, 0xFFFF, "Other standardised objects"},
};

// Escapes characters that would end a table cell or begin a tag.
std::string cell(std::string_view text) {
  std::string escaped;
  for (const char letter : text) {
    if (letter == '|' || letter == '<' || letter == '*' || letter == '_' || letter == '`' || letter == '\\') {
      escaped += '\\';
    }
    escaped += letter == '\n' || letter == '\r' ? ' ' : letter;
  }
  return escaped;
}

std::string range(const Entry& entry) {
  if (!entry.has_range) return "";
  return fmt::format("{} to {}", number_text(entry, entry.minimum), number_text(entry, entry.maximum));
}

std::string row(const Entry& entry) {
  return fmt::format("| 0x{:04X} | {} | {} | {} | {} | {} | {}{} | {} | {} | {} |\n", entry.index, entry.sub,
                     cell(entry.name), cell(word(entry.type)), word(entry.access), word(entry.pdo),
                     cell(default_text(entry)), entry.default_adds_node_id ? " + NodeID" : "", range(entry),
                     cell(entry.unit), entry.saved ? "yes" : "");
}

std::string list(const std::vector<unsigned>& values) {
  return values.empty() ? "none" : fmt::format("{}", fmt::join(values, ", "));
}

}  // namespace

std::string markdown(const Description& description) {
  std::string page = fmt::format("# {}: objects\n\n", cell(description.product_name));
  page += "| | |\n|---|---|\n";
  page += fmt::format("| Vendor | {} (0x{:08X}) |\n", cell(description.vendor_name), identity(description.table, 1));
  page += fmt::format("| Product code | 0x{:08X} |\n", identity(description.table, 2));
  page += fmt::format("| Revision | 0x{:08X} |\n", identity(description.table, 3));
  page += fmt::format("| CAN bit rates, kbit/s | {} |\n", list(description.bit_rates_kbit));
  page += fmt::format("| RPDOs, TPDOs | {}, {} |\n", count_rpdos(description.table), count_tpdos(description.table));
  page += fmt::format("| LSS | {} |\n", description.lss_supported ? "yes" : "no");
  page +=
      "\nPDO: *rx* can be received in an RPDO, *tx* sent in a TPDO. Where no range is given, the type's holds. "
      "*Saved*: part of"
      " the non-volatile image.\n";
  for (const Group& group : groups) {
    bool is_empty = true;
    for (const Entry& entry : description.table) {
      if (entry.index < group.first || entry.index > group.last) continue;
      if (is_empty) {
        page += fmt::format("\n## {}\n\n", group.title);
        page += "| Index | Sub | Name | Type | Access | PDO | Default | Range | Unit | Saved |\n";
        page += "|---|---|---|---|---|---|---|---|---|---|\n";
        is_empty = false;
      }
      page += row(entry);
    }
  }
  return page;
}

}  // namespace servodrome::describe
