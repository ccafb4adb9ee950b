#include <algorithm>
#include <fmt/format.h>

#include "describe/description.hpp"
#include "describe/words.hpp"

namespace servodrome::describe {
namespace {

using dictionary::Entry;

// Formats a field as in RFC 4180.
std::string field(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char letter : text) {
    if (letter == '"') quoted += '"';
    quoted += letter;
  }
  return quoted + '"';
}

}  // namespace

std::string csv(std::span<const Entry> table) {
  std::string text = "index,sub,name,type,access,pdo,default,min,max,unit,saved\n";
  for (const Entry& entry : table) {
    text += fmt::format(
        "0x{:04X},0x{:02X},{},{},{},{},{}{},{},{},{},{}\n", entry.index, entry.sub, field(entry.name), word(entry.type),
        word(entry.access), word(entry.pdo), field(default_text(entry)), entry.default_adds_node_id ? "+NodeID" : "",
        entry.has_range ? number_text(entry, entry.minimum) : "",
        entry.has_range ? number_text(entry, entry.maximum) : "", field(entry.unit), entry.saved ? "yes" : "");
  }
  return text;
}

std::string register_list(std::span<const modbus::Register> registers, std::span<const Entry> table) {
  std::string text = "register,words,index,sub,name,type,access,min,max,unit\n";
  for (const modbus::Register& row : registers) {
    const auto entry = std::find_if(table.begin(), table.end(), [&row](const Entry& candidate) {
      return candidate.index == row.index && candidate.sub == row.sub;
    });
    if (entry == table.end()) continue;  // the map is invalid
    text += fmt::format("0x{:04X},{},0x{:04X},0x{:02X},{},{},{},{},{},{}\n", row.address, row.words, row.index, row.sub,
                        field(entry->name), word(entry->type), word(entry->access),
                        entry->has_range ? number_text(*entry, entry->minimum) : "",
                        entry->has_range ? number_text(*entry, entry->maximum) : "", field(entry->unit));
  }
  return text;
}

}  // namespace servodrome::describe
