// The object dictionary of an ESI file: data types by name, objects of these types (ETG.2000, ETG.1020).
#include <algorithm>
#include <charconv>
#include <fmt/format.h>

#include "describe/esi_document.hpp"

namespace servodrome::describe {

using dictionary::Access;
using dictionary::ObjectCode;
using dictionary::Pdo;
using dictionary::Type;

namespace {

constexpr unsigned deepest_type = 8;  // limit for a chain of types that rename other types

unsigned bits_of(const pugi::xml_node& node) {
  return static_cast<unsigned>(
      std::clamp<std::int64_t>(parse_xml_number(text_of(node.child("BitSize"))).value_or(0), 0, std::int64_t{8} << 20));
}

// Parses pairs of hexadecimal digits; the first pair is the lowest byte of a number.
std::optional<std::string> bytes_of(std::string_view digits) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    unsigned byte = 0;
    const auto [end, error] = std::from_chars(digits.data() + i, digits.data() + i + 2, byte, 16);
    if (error != std::errc{} || end != digits.data() + i + 2) return std::nullopt;
    bytes += static_cast<char>(byte);
  }
  if (digits.size() % 2 != 0) return std::nullopt;
  return bytes;
}

// Converts a number to the type: hexadecimal values of signed types are bit patterns.
std::int64_t of_type(Type type, std::int64_t value) {
  const unsigned bits = dictionary::size_of(type) * 8U;
  if (!dictionary::is_signed(type) || bits == 64 || value <= dictionary::maximum_of(type)) return value;
  return value >> bits != 0 ? value : value - (std::int64_t{1} << bits);
}

}  // namespace

bool EsiDictionaryReader::read(const pugi::xml_node& dictionary) {
  for (const pugi::xml_node& type : dictionary.child("DataTypes").children("DataType")) {
    types_[text_of(type.child("Name"))] = type;
  }
  bool any = false;
  for (const pugi::xml_node& object : dictionary.child("Objects").children("Object")) {
    read_object(object);
    any = true;
  }
  return any;
}

// Resolves a type that only renames another type, as enumerations do.
pugi::xml_node EsiDictionaryReader::data_type(const std::string& name) const {
  std::string wanted = name;
  pugi::xml_node type;
  for (unsigned depth = 0; depth < deepest_type; ++depth) {
    const auto found = types_.find(wanted);
    if (found == types_.end()) return type;
    type = found->second;
    const std::string base = text_of(type.child("BaseType"));
    if (base.empty() || type.child("ArrayInfo") || type.child("SubItem")) return type;
    wanted = base;
  }
  return type;
}

void EsiDictionaryReader::read_object(const pugi::xml_node& object) {
  const std::int64_t index = document_.number(object.child("Index"), "Object Index");
  if (index < 0 || index > 0xFFFF)
    document_.refuse(object, "Object Index", fmt::format("{} is not an index", index), "write #x1000 to #xFFFF");
  FileEntry common;
  common.index = static_cast<std::uint16_t>(index);
  common.object_name = english(object, "Name");
  common.line = document_.line_of(object);
  const std::string type_name = text_of(object.child("Type"));
  const pugi::xml_node type = data_type(type_name);
  if (type.child("SubItem")) return read_parts(object, type, common);
  FileEntry entry = common;
  entry.name = entry.object_name;
  set_type(entry, type_name, object, bits_of(object));
  set_flags(entry, object.child("Flags"));
  set_values(entry, object.child("Info"));
  adder_.add(std::move(entry));
}

void EsiDictionaryReader::check_number_of(const std::vector<FileEntry>& parts, std::int64_t more,
                                          const pugi::xml_node& at) const {
  constexpr std::int64_t most = 256;
  if (static_cast<std::int64_t>(parts.size()) + more <= most) return;
  document_.refuse(at, "SubItem", "the type has more than 256 sub-indices", "leave some out");
}

void EsiDictionaryReader::read_parts(const pugi::xml_node& object, const pugi::xml_node& type,
                                     const FileEntry& common) {
  std::vector<FileEntry> parts;  // still without the name of the object
  std::vector<std::string> type_names;
  bool is_array = false;
  for (const pugi::xml_node& item : type.children("SubItem")) {
    const std::string item_type = text_of(item.child("Type"));
    const pugi::xml_node its_type = data_type(item_type);
    const pugi::xml_node array = its_type.child("ArrayInfo");
    FileEntry entry;
    entry.index = common.index;
    entry.line = common.line;
    entry.code = ObjectCode::record;
    entry.name = text_of(item.child("Name"));
    set_flags(entry, item.child("Flags"));
    const auto sub = parse_xml_number(text_of(item.child("SubIdx")));
    if (array && !sub) {
      is_array = true;
      const std::int64_t first = parse_xml_number(text_of(array.child("LBound"))).value_or(1);
      const std::int64_t count = parse_xml_number(text_of(array.child("Elements"))).value_or(0);
      if (first < 0 || first > 0xFF || count < 0 || count > 0xFF - first) {
        document_.refuse(array, "ArrayInfo", fmt::format("{} elements from {} on are not possible", count, first),
                         "an object has sub-indices 1 to 254");
      }
      check_number_of(parts, count, item);
      set_type(entry, text_of(its_type.child("BaseType")), array,
               static_cast<unsigned>(bits_of(its_type) / std::max<std::int64_t>(count, 1)));
      for (std::int64_t i = 0; i < count; ++i) {
        entry.sub = static_cast<std::uint8_t>(first + i);
        entry.name = fmt::format("SubIndex {:03}", entry.sub);
        parts.push_back(entry);
        type_names.push_back(entry.name);
      }
      continue;
    }
    if (!sub) continue;  // padding
    if (*sub < 0 || *sub > 0xFF)
      document_.refuse(item, "SubIdx", fmt::format("{} is not a sub-index", *sub), "write 0 to 255");
    check_number_of(parts, 1, item);
    entry.sub = static_cast<std::uint8_t>(*sub);
    set_type(entry, item_type, item, bits_of(item));
    type_names.push_back(entry.name);
    parts.push_back(std::move(entry));
  }
  // The values are in the order of the type's parts; if some are missing, they are found by name.
  const pugi::xml_node info = object.child("Info");
  const auto items = info.children("SubItem");
  const bool in_order = static_cast<std::size_t>(std::distance(items.begin(), items.end())) == parts.size();
  std::size_t n = 0;
  for (const pugi::xml_node& item : items) {
    const std::string name = text_of(item.child("Name"));
    std::size_t place = n++;
    if (!in_order) {
      const auto found = std::find(type_names.begin(), type_names.end(), name);
      if (found == type_names.end()) continue;
      place = static_cast<std::size_t>(found - type_names.begin());
    }
    set_values(parts[place], item.child("Info"));
    const std::string shown = english(item.child("Info"), "DisplayName");
    if (!shown.empty()) parts[place].name = shown;
  }
  for (FileEntry& part : parts) {
    if (is_array) part.code = ObjectCode::array;
    part.object_name = common.object_name;
    adder_.add(std::move(part));
  }
}

void EsiDictionaryReader::set_type(FileEntry& entry, const std::string& type, const pugi::xml_node& at,
                                   unsigned bits) const {
  const pugi::xml_node described = data_type(type);
  const std::string base = text_of(described.child("BaseType"));
  std::string name = described ? text_of(described.child("Name")) : type;
  if (!base.empty() && !described.child("ArrayInfo")) name = base;
  if (bits == 0) bits = bits_of(described);
  entry.type = type_of_name(name, bits);
  if (dictionary::size_of(entry.type) == 0) entry.capacity = std::max((bits + 7) / 8, 1U);
  if (type.empty()) document_.refuse(at, "Type", fmt::format("the object {:04X}h has no type", entry.index), "add one");
}

void EsiDictionaryReader::set_flags(FileEntry& entry, const pugi::xml_node& flags) const {
  const std::string access = text_of(flags.child("Access"));
  if (access.empty() || access == "rw") {
    entry.access = flags ? Access::rw : Access::ro;
  } else if (access == "ro" || access == "const") {
    entry.access = Access::ro;
  } else if (access == "wo") {
    entry.access = Access::wo;
  } else {
    document_.refuse(flags, "Access", fmt::format("\"{}\" is not an access type", access), "write ro, rw or wo");
  }
  unsigned pdo = 0;
  for (const char letter : text_of(flags.child("PdoMapping"))) {
    if (letter == 'R' || letter == 'r') pdo |= static_cast<unsigned>(Pdo::rpdo);
    if (letter == 'T' || letter == 't') pdo |= static_cast<unsigned>(Pdo::tpdo);
  }
  entry.pdo = static_cast<Pdo>(pdo);
  if (const std::string backup = text_of(flags.child("Backup")); !backup.empty()) entry.saved = backup != "0";
}

void EsiDictionaryReader::set_values(FileEntry& entry, const pugi::xml_node& info) const {
  const pugi::xml_node data = info.child("DefaultData");
  const pugi::xml_node value = info.child("DefaultValue");
  if (dictionary::size_of(entry.type) == 0) {
    entry.content = text_of(info.child("DefaultString"));
    if (data) entry.content = bytes_of(text_of(data)).value_or("");
    if (entry.type == Type::visible_string) entry.content.erase(entry.content.find_last_not_of('\0') + 1);
    return;
  }
  if (data) {
    const auto bytes = bytes_of(text_of(data));
    if (!bytes || bytes->empty() || bytes->size() > 8) {
      document_.refuse(data, fmt::format("{:04X}:{:02X} DefaultData", entry.index, entry.sub),
                       fmt::format("\"{}\" is not a value", text_of(data).substr(0, 40)),
                       "write pairs of hexadecimal digits, the lowest byte first");
    }
    std::uint64_t number = 0;
    for (std::size_t i = 0; i < bytes->size(); ++i) {
      number |= std::uint64_t{static_cast<std::uint8_t>((*bytes)[i])} << 8 * i;
    }
    entry.default_value = of_type(entry.type, static_cast<std::int64_t>(number));
  } else if (value) {
    entry.default_value = of_type(entry.type, document_.number(value, "DefaultValue"));
  }
  const auto limit = [&](const char* name, std::optional<std::int64_t>& limit_of_entry) {
    const pugi::xml_node node = info.child(name);
    if (!node || entry.type == Type::real32) return;
    if (const auto number = parse_xml_number(text_of(node))) limit_of_entry = of_type(entry.type, *number);
  };
  limit("MinValue", entry.minimum);
  limit("MaxValue", entry.maximum);
}

}  // namespace servodrome::describe
