#include "axis/object_catalogue.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "canopen/301/communication_section.hpp"
#include "describe/device_file.hpp"
#include "drive/cia402_section.hpp"
#include "links/number_text.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/error.hpp"

namespace servodrome::master {
namespace {

using dictionary::Type;

// Used only for names and types; the number of PDOs is irrelevant.
using Communication = canopen::CommunicationObjects<4, 4, 8>;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool is_ignored(char c) { return c == ' ' || c == '_' || c == '-'; }

// Lower case, without blanks, underscores and hyphens.
std::string plain(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (!is_ignored(c)) result += lower(c);
  }
  return result;
}

// Removes plain(name) from the front of `wanted`. false: `wanted` begins with something else.
bool take_plain(std::string_view name, std::string_view& wanted) {
  for (const char c : name) {
    if (is_ignored(c)) continue;
    if (wanted.empty() || wanted.front() != lower(c)) return false;
    wanted.remove_prefix(1);
  }
  return true;
}

// plain(name) == wanted, without a string in memory: a name is compared with those of hundreds of objects.
bool is_plain(std::string_view name, std::string_view wanted) { return take_plain(name, wanted) && wanted.empty(); }

bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool starts_with_0x(std::string_view text) { return text.size() > 2 && text[0] == '0' && lower(text[1]) == 'x'; }

std::optional<std::uint32_t> parse_hex(std::string_view text) {
  if (starts_with_0x(text)) text.remove_prefix(2);
  if (!text.empty() && lower(text.back()) == 'h') text.remove_suffix(1);
  return links::number_of_text<std::uint32_t>(text, 16);
}

std::optional<ObjectAddress> parse_address(std::string_view text) {
  const std::size_t colon = text.find(':');
  const auto index = parse_hex(text.substr(0, colon));
  const auto sub = colon == std::string_view::npos ? std::uint32_t{0} : parse_hex(text.substr(colon + 1));
  if (!index || *index > 0xFFFF || !sub || *sub > 0xFF) return std::nullopt;
  return ObjectAddress{static_cast<std::uint16_t>(*index), static_cast<std::uint8_t>(*sub)};
}

struct TypeWord {
  std::string_view word;
  Type type;
};
constexpr auto type_words = std::to_array<TypeWord>({{"boolean", Type::boolean},
                                                     {"bool", Type::boolean},
                                                     {"integer8", Type::integer8},
                                                     {"i8", Type::integer8},
                                                     {"integer16", Type::integer16},
                                                     {"i16", Type::integer16},
                                                     {"integer32", Type::integer32},
                                                     {"i32", Type::integer32},
                                                     {"integer64", Type::integer64},
                                                     {"i64", Type::integer64},
                                                     {"unsigned8", Type::unsigned8},
                                                     {"u8", Type::unsigned8},
                                                     {"unsigned16", Type::unsigned16},
                                                     {"u16", Type::unsigned16},
                                                     {"unsigned32", Type::unsigned32},
                                                     {"u32", Type::unsigned32},
                                                     {"unsigned64", Type::unsigned64},
                                                     {"u64", Type::unsigned64},
                                                     {"real32", Type::real32},
                                                     {"f32", Type::real32},
                                                     {"visiblestring", Type::visible_string},
                                                     {"string", Type::visible_string},
                                                     {"octetstring", Type::octet_string},
                                                     {"bytes", Type::octet_string},
                                                     {"domain", Type::domain}});

[[noreturn]] void refuse_value(std::string_view text, const std::string& what) {
  throw MasterError(what, fmt::format("value \"{}\"", text), "give a value of the object's type, or another --type");
}

}  // namespace

const ObjectCatalogue& ObjectCatalogue::standard() {
  static const ObjectCatalogue catalogue = [] {
    ObjectCatalogue made;
    for (const auto& entry : canopen::general_section<Communication>) made.add(entry);
    for (const auto& entry : canopen::sdo_server_section<Communication>) made.add(entry);
    for (const auto& entry : canopen::rpdo_section<Communication>) made.add(entry);
    for (const auto& entry : canopen::tpdo_section<Communication>) made.add(entry);
    for (const auto& entry : drive::cia402_section) made.add(entry);
    const auto text = [&](std::uint16_t index, const char* name) {
      made.objects_.push_back({{index, 0}, name, name, Type::visible_string});
    };
    text(0x1008, "Manufacturer device name");
    text(0x1009, "Manufacturer hardware version");
    text(0x100A, "Manufacturer software version");
    made.sort();
    return made;
  }();
  return catalogue;
}

ObjectCatalogue ObjectCatalogue::read_eds(std::istream& in, const std::string& file) {
  try {
    return of(describe::read_eds(in, file));
  } catch (const describe::DeviceFileError& error) {
    throw MasterError(error.problem(), error.where(), error.remedy());
  }
}

ObjectCatalogue ObjectCatalogue::of(const describe::DeviceFile& device) {
  ObjectCatalogue catalogue;
  for (const describe::FileEntry& entry : device.entries) {
    catalogue.objects_.push_back({{entry.index, entry.sub},
                                  entry.object_name,
                                  entry.name,
                                  entry.type,
                                  entry.access,
                                  entry.default_value,
                                  entry.default_adds_node_id,
                                  entry.minimum,
                                  entry.maximum,
                                  entry.unit});
  }
  catalogue.sort();
  return catalogue;
}

ObjectCatalogue ObjectCatalogue::of(std::span<const dictionary::Entry> table, std::string_view product) {
  ObjectCatalogue catalogue;
  catalogue.product_ = product;
  for (const dictionary::Entry& entry : table) catalogue.add(entry);
  catalogue.sort();
  return catalogue;
}

// Entries must be added in ascending order of index and sub-index.
void ObjectCatalogue::add(const dictionary::Entry& entry) {
  const std::string object_name = entry.sub == 0 || objects_.empty() ? entry.name : objects_.back().object_name;
  const bool is_count =
      entry.sub == 0 && (entry.code == dictionary::ObjectCode::array || entry.code == dictionary::ObjectCode::record);
  objects_.push_back({.address = {entry.index, entry.sub},
                      .object_name = object_name,
                      .name = is_count ? "Highest sub-index" : entry.name,
                      .type = entry.type,
                      .unit = entry.unit});
}

void ObjectCatalogue::sort() {
  std::sort(objects_.begin(), objects_.end(),
            [](const NamedObject& a, const NamedObject& b) { return a.address < b.address; });
}

const NamedObject* ObjectCatalogue::find(ObjectAddress address) const {
  const auto found =
      std::lower_bound(objects_.begin(), objects_.end(), address,
                       [](const NamedObject& object, ObjectAddress wanted) { return object.address < wanted; });
  return found != objects_.end() && found->address == address ? &*found : nullptr;
}

// Returns true for letters followed by digits: "P01-02", "d08", "Pn100".
bool is_number(std::string_view word) {
  const auto digit = std::find_if(word.begin(), word.end(), is_digit);
  const auto is_letter = [](char c) { return lower(c) >= 'a' && lower(c) <= 'z'; };
  return digit != word.begin() && digit != word.end() && std::all_of(word.begin(), digit, is_letter) &&
         std::all_of(digit, word.end(), [](char c) { return is_digit(c) || c == '-'; });
}

// Finds objects by the name of the sub-index alone, or by the maker's number in front of it: "P01-02" for "P01-02
// Real-time adjustment mode".
std::vector<const NamedObject*> ObjectCatalogue::find_short(std::string_view wanted) const {
  std::vector<const NamedObject*> found;
  for (const NamedObject& object : objects_) {
    const std::string_view name = object.name;
    const std::string_view word = name.substr(0, name.find(' '));
    const bool by_number = word != name && is_number(word) && is_plain(word, wanted);
    if (by_number || is_plain(name, wanted)) found.push_back(&object);
  }
  return found;
}

ObjectAddress ObjectCatalogue::resolve(std::string_view text) const {
  const std::string wanted = plain(text);
  if (const auto address = parse_address(text)) {
    // "d08" may be an address or a maker's number: if no object has that address, a unique number is used.
    const auto numbers = find(*address) == nullptr ? find_short(wanted) : std::vector<const NamedObject*>{};
    return numbers.size() == 1 ? numbers.front()->address : *address;
  }
  const NamedObject* found = nullptr;
  bool in_parts = false;
  for (const NamedObject& object : objects_) {
    const bool simple = object.address.sub == 0 && object.name == object.object_name;
    std::string_view part = wanted;
    const bool begins = take_plain(object.object_name, part);
    const bool is_full = begins && part.starts_with('.') && is_plain(object.name, part.substr(1));
    if (found == nullptr && (is_full || (simple && is_plain(object.name, wanted)))) found = &object;
    in_parts = in_parts || (!simple && begins && part.empty());
  }
  if (found != nullptr) return found->address;
  const std::string where = fmt::format("object \"{}\"", text);
  const auto short_named = in_parts ? std::vector<const NamedObject*>{} : find_short(wanted);
  if (short_named.size() == 1) return short_named.front()->address;
  if (!short_named.empty()) {
    constexpr std::size_t most_listed = 6;
    std::string list;
    for (std::size_t i = 0; i < std::min(short_named.size(), most_listed); ++i) {
      list += fmt::format("{}{}", i == 0 ? "" : ", ", title(short_named[i]->address));
    }
    if (short_named.size() > most_listed) list += fmt::format(" and {} more", short_named.size() - most_listed);
    throw MasterError("several objects have this name", where, fmt::format("write INDEX:SUB of one: {}", list));
  }
  if (in_parts) throw MasterError("it has sub-indices", where, "write INDEX:SUB, or OBJECT.NAME of the sub-index");
  throw MasterError(
      "no object has this name", where,
      "write INDEX[:SUB] in hexadecimal, a name of CiA 301 or CiA 402, or give the drive's EDS with --eds");
}

std::string ObjectCatalogue::title(ObjectAddress address) const {
  const NamedObject* object = find(address);
  if (object == nullptr) return text_of(address);
  if (object->name == object->object_name) return fmt::format("{} {}", text_of(address), object->name);
  return fmt::format("{} {}.{}", text_of(address), object->object_name, object->name);
}

std::optional<Type> parse_type(std::string_view word) {
  const std::string wanted = plain(word);
  for (const TypeWord& one : type_words) {
    if (one.word == wanted) return one.type;
  }
  return std::nullopt;
}

std::string_view short_word(Type type) {
  if (type == Type::domain) type = Type::octet_string;
  std::string_view shortest = "bytes";
  for (const TypeWord& one : type_words) {
    if (one.type == type) shortest = one.word;  // in the table the short name follows the long one
  }
  return shortest;
}

std::string text_of_value(std::span<const std::byte> bytes, std::optional<Type> type) {
  const auto as_bytes = [&] {
    std::string text;
    for (const std::byte byte : bytes) {
      text += fmt::format("{}{:02X}", text.empty() ? "" : " ", std::to_integer<unsigned>(byte));
    }
    return text;
  };
  const auto as_text = [&] {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    // Escapes control characters, so that text from a drive cannot move the cursor, colour the terminal or begin a
    // line.
    std::string shown;
    for (const char c : text.substr(0, text.find_last_not_of('\0') + 1)) {
      const auto code = static_cast<unsigned char>(c);
      shown += code < 0x20 || code == 0x7F ? fmt::format("\\x{:02X}", code) : std::string(1, c);
    }
    return fmt::format("\"{}\"", shown);
  };
  if (!type) {
    if (bytes.size() == 1 || bytes.size() == 2 || bytes.size() == 4 || bytes.size() == 8) {
      type = bytes.size() == 1   ? Type::unsigned8
             : bytes.size() == 2 ? Type::unsigned16
             : bytes.size() == 4 ? Type::unsigned32
                                 : Type::unsigned64;
    } else {
      const bool printable = std::all_of(bytes.begin(), bytes.end(), [](std::byte byte) {
        return std::to_integer<unsigned>(byte) >= 0x20 && std::to_integer<unsigned>(byte) < 0x7F;
      });
      return printable ? as_text() : as_bytes();
    }
  }
  if (*type == Type::visible_string) return as_text();
  if (dictionary::size_of(*type) == 0 || bytes.empty() || bytes.size() > 8) return as_bytes();
  std::uint64_t raw = 0;
  std::memcpy(&raw, bytes.data(), bytes.size());
  if (*type == Type::real32) return fmt::format("{}", std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
  if (dictionary::is_signed(*type)) {
    const auto shift = static_cast<unsigned>(64 - 8 * bytes.size());
    return fmt::format("{}", static_cast<std::int64_t>(raw << shift) >> shift);
  }
  return fmt::format("{} ({:0{}X}h)", raw, raw, bytes.size() * 2);
}

std::vector<std::byte> parse_value(std::string_view text, Type type) {
  const auto bytes_of = [](const void* data, std::size_t size) {
    const auto* first = static_cast<const std::byte*>(data);
    return std::vector<std::byte>(first, first + size);
  };
  if (type == Type::visible_string) return bytes_of(text.data(), text.size());
  const std::size_t size = dictionary::size_of(type);
  if (size == 0) {
    std::vector<std::byte> bytes;
    std::string digits = plain(text);
    if (digits.size() % 2 != 0) refuse_value(text, "an odd number of hexadecimal digits does not give whole bytes");
    for (std::size_t i = 0; i < digits.size(); i += 2) {
      const auto byte = links::number_of_text<std::uint8_t>(std::string_view(digits).substr(i, 2), 16);
      if (!byte) refuse_value(text, "bytes are written in hexadecimal");
      bytes.push_back(static_cast<std::byte>(*byte));
    }
    return bytes;
  }
  if (type == Type::real32) {
    const auto number = links::number_of_text<float>(text);
    if (!number) refuse_value(text, "it is not a number");
    return bytes_of(&*number, sizeof *number);
  }
  if (type == Type::boolean && (plain(text) == "true" || plain(text) == "false")) {
    const bool value = plain(text) == "true";
    return bytes_of(&value, 1);
  }
  std::string_view digits = text;
  const bool negative = !digits.empty() && digits.front() == '-';
  if (negative) digits.remove_prefix(1);
  int base = 10;
  if (starts_with_0x(digits)) {
    digits.remove_prefix(2);
    base = 16;
  } else if (!digits.empty() && lower(digits.back()) == 'h') {
    digits.remove_suffix(1);
    base = 16;
  }
  const auto read = links::number_of_text<std::uint64_t>(digits, base);
  if (!read) refuse_value(text, "it is not a whole number");
  const std::uint64_t magnitude = *read;
  // Hexadecimal input is the bit pattern; decimal input is the number, which must be within the type's range.
  const unsigned bits = static_cast<unsigned>(size * 8);
  const std::uint64_t all_ones = ~std::uint64_t{0} >> (64 - bits);
  const std::uint64_t highest = type == Type::boolean                       ? 1
                                : dictionary::is_signed(type) && base == 10 ? all_ones >> 1
                                                                            : all_ones;
  const std::uint64_t lowest = dictionary::is_signed(type) ? (all_ones >> 1) + 1 : 0;
  if (magnitude > (negative ? lowest : highest)) {
    refuse_value(
        text, fmt::format("it is outside {}, {}{} .. {}", short_word(type), lowest != 0 ? "-" : "", lowest, highest));
  }
  const std::uint64_t value = negative ? ~magnitude + 1 : magnitude;
  return bytes_of(&value, size);
}

}  // namespace servodrome::master
