#include "describe/words.hpp"

#include <algorithm>
#include <bit>
#include <fmt/format.h>

namespace servodrome::describe {

using dictionary::Access;
using dictionary::Entry;
using dictionary::Pdo;
using dictionary::Type;

std::string_view word(Type type) {
  switch (type) {
    case Type::boolean: return "BOOLEAN";
    case Type::integer8: return "INTEGER8";
    case Type::integer16: return "INTEGER16";
    case Type::integer32: return "INTEGER32";
    case Type::integer64: return "INTEGER64";
    case Type::unsigned8: return "UNSIGNED8";
    case Type::unsigned16: return "UNSIGNED16";
    case Type::unsigned32: return "UNSIGNED32";
    case Type::unsigned64: return "UNSIGNED64";
    case Type::real32: return "REAL32";
    case Type::visible_string: return "VISIBLE_STRING";
    case Type::octet_string: return "OCTET_STRING";
    case Type::domain: return "DOMAIN";
  }
  return "";
}

std::string_view word(Access access) {
  switch (access) {
    case Access::constant: return "const";
    case Access::ro: return "ro";
    case Access::wo: return "wo";
    case Access::rw: return "rw";
  }
  return "";
}

std::string_view word(Pdo pdo) {
  switch (pdo) {
    case Pdo::none: return "none";
    case Pdo::rpdo: return "rx";
    case Pdo::tpdo: return "tx";
    case Pdo::both: return "both";
  }
  return "";
}

std::string number_text(const Entry& entry, std::int64_t value) {
  if (entry.type == Type::real32) return fmt::format("{}", std::bit_cast<float>(static_cast<std::uint32_t>(value)));
  if (dictionary::is_signed(entry.type)) return fmt::format("{}", value);
  const auto number = static_cast<std::uint64_t>(value);
  // In the communication area, an UNSIGNED32 with a unit is a time or count; one without a unit consists of bit fields.
  const bool has_bit_fields = entry.type == Type::unsigned32 && entry.unit[0] == '\0' &&
                              dictionary::area_of(entry.index) == dictionary::Area::communication;
  if (!has_bit_fields) return fmt::format("{}", number);
  return entry.default_adds_node_id ? fmt::format("0x{:X}", number) : fmt::format("0x{:08X}", number);
}

std::string default_text(const Entry& entry) {
  if (entry.fixed_size()) return number_text(entry, entry.default_value);
  return entry.text == nullptr ? "" : entry.text;
}

std::size_t entries_of_object(std::span<const Entry> table, std::size_t position) {
  std::size_t end = position;
  while (end < table.size() && table[end].index == table[position].index) ++end;
  return end - position;
}

std::uint32_t identity(std::span<const Entry> table, std::uint8_t sub) {
  const auto found = std::find_if(table.begin(), table.end(),
                                  [sub](const Entry& entry) { return entry.index == 0x1018 && entry.sub == sub; });
  return found == table.end() ? 0 : static_cast<std::uint32_t>(found->default_value);
}

unsigned count_objects(std::span<const Entry> table, std::uint16_t first, std::uint16_t last) {
  return static_cast<unsigned>(std::count_if(table.begin(), table.end(), [=](const Entry& entry) {
    return entry.sub == 0 && entry.index >= first && entry.index <= last;
  }));
}

}  // namespace servodrome::describe
