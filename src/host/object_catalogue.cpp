#include "host/object_catalogue.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fmt/format.h>
#include <map>

#include "canopen/301/communication_section.hpp"
#include "drive/cia402_section.hpp"
#include "host/canopen/sdo_client.hpp"
#include "host/error.hpp"

namespace servodrome::host {
namespace {

using dictionary::Type;

// Only for names and types: how many PDOs a device has does not matter here.
using Communication = canopen::CommunicationObjects<4, 4, 8>;

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

// Letters and digits only.
std::string plain(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c != ' ' && c != '_' && c != '-') result += lower(c);
  }
  return result;
}

std::string_view trim(std::string_view text) {
  constexpr std::string_view blank = " \t\r\n";
  const std::size_t first = text.find_first_not_of(blank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blank) - first + 1);
}

bool starts_with_0x(std::string_view text) { return text.size() > 2 && text[0] == '0' && lower(text[1]) == 'x'; }

std::optional<std::uint32_t> parse_hex(std::string_view text) {
  if (starts_with_0x(text)) text.remove_prefix(2);
  if (!text.empty() && lower(text.back()) == 'h') text.remove_suffix(1);
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<std::uint32_t> parse_decimal(std::string_view text) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<ObjectAddress> parse_address(std::string_view text) {
  const std::size_t colon = text.find(':');
  const auto index = parse_hex(text.substr(0, colon));
  const auto sub = colon == std::string_view::npos ? std::uint32_t{0} : parse_hex(text.substr(colon + 1));
  if (!index || *index > 0xFFFF || !sub || *sub > 0xFF) return std::nullopt;
  return ObjectAddress{static_cast<std::uint16_t>(*index), static_cast<std::uint8_t>(*sub)};
}

bool is_hex_digit(char c) { return (c >= '0' && c <= '9') || (lower(c) >= 'a' && lower(c) <= 'f'); }

struct EdsSection {
  ObjectAddress address;
  bool is_whole_object = false;
};

// "6041" or "6099sub1"; nothing for the other sections of an EDS.
std::optional<EdsSection> parse_section(std::string_view section) {
  const bool is_object = section.size() >= 4 && std::all_of(section.begin(), section.begin() + 4, is_hex_digit);
  if (!is_object) return std::nullopt;
  const auto index = static_cast<std::uint16_t>(*parse_hex(section.substr(0, 4)));
  const std::string_view rest = section.substr(4);
  if (rest.empty()) return EdsSection{{index, 0}, true};
  if (rest.size() < 4 || plain(rest.substr(0, 3)) != "sub") return std::nullopt;
  const auto sub = parse_hex(rest.substr(3));
  if (!sub || *sub > 0xFF) return std::nullopt;
  return EdsSection{{index, static_cast<std::uint8_t>(*sub)}, false};
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

bool is_known(std::uint32_t number) {
  return std::any_of(type_words.begin(), type_words.end(),
                     [number](const TypeWord& word) { return static_cast<std::uint32_t>(word.type) == number; });
}

// CiA 306-1: rwr and rww are rw, and say in which PDOs besides.
std::optional<dictionary::Access> parse_access(std::string_view word) {
  using dictionary::Access;
  if (word == "ro") return Access::ro;
  if (word == "wo") return Access::wo;
  if (word == "rw" || word == "rwr" || word == "rww") return Access::rw;
  if (word == "const") return Access::constant;
  return std::nullopt;
}

[[noreturn]] void refuse_value(std::string_view text, const std::string& what) {
  throw HostError(what, fmt::format("value \"{}\"", text), "give a value of the object's type, or another --type");
}

}  // namespace

const ObjectCatalogue& ObjectCatalogue::standard() {
  static const ObjectCatalogue catalogue = [] {
    ObjectCatalogue made;
    std::string object_name;
    const auto add = [&](const dictionary::Entry& entry) {
      if (entry.sub == 0) object_name = entry.name;
      const bool is_count = entry.sub == 0 && entry.code != dictionary::ObjectCode::var;
      made.objects_.push_back(
          {{entry.index, entry.sub}, object_name, is_count ? "Highest sub-index" : entry.name, entry.type});
    };
    for (const auto& entry : canopen::general_section<Communication>) add(entry);
    for (const auto& entry : canopen::sdo_server_section<Communication>) add(entry);
    for (const auto& entry : canopen::rpdo_section<Communication>) add(entry);
    for (const auto& entry : canopen::tpdo_section<Communication>) add(entry);
    for (const auto& entry : drive::cia402_section) add(entry);
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
  struct Section {
    std::string name;
    std::optional<Type> type;
    bool has_type = false;
    std::optional<dictionary::Access> access{};
    std::string default_value{};
    std::string low_limit{};
    std::string high_limit{};

    NamedObject as(ObjectAddress address, const std::string& object_name) const {
      return {address, object_name, name, type, access, default_value, low_limit, high_limit};
    }
  };
  std::map<std::uint16_t, Section> objects;   // [6099]
  std::map<ObjectAddress, Section> elements;  // [6099sub1]
  Section* present = nullptr;
  std::string line;
  while (std::getline(in, line)) {
    const std::string_view text = trim(line);
    if (text.empty() || text.front() == ';') continue;
    if (text.front() == '[' && text.back() == ']') {
      const auto section = parse_section(text.substr(1, text.size() - 2));
      present = !section                   ? nullptr
                : section->is_whole_object ? &objects[section->address.index]
                                           : &elements[section->address];
      continue;
    }
    const std::size_t equals = text.find('=');
    if (present == nullptr || equals == std::string_view::npos) continue;
    const std::string key = plain(trim(text.substr(0, equals)));
    const std::string_view value = trim(text.substr(equals + 1));
    if (key == "parametername") {
      present->name = value;
    } else if (key == "datatype") {
      present->has_type = true;
      const auto number = starts_with_0x(value) ? parse_hex(value) : parse_decimal(value);
      if (number && is_known(*number)) present->type = static_cast<Type>(*number);
    } else if (key == "accesstype") {
      present->access = parse_access(plain(value));
    } else if (key == "defaultvalue") {
      present->default_value = value;
    } else if (key == "lowlimit") {
      present->low_limit = value;
    } else if (key == "highlimit") {
      present->high_limit = value;
    }
  }
  ObjectCatalogue catalogue;
  // An ARRAY or RECORD has no type; its sub-index 0 is a section of its own.
  for (const auto& [index, object] : objects) {
    if (object.has_type) catalogue.objects_.push_back(object.as({index, 0}, object.name));
  }
  for (const auto& [address, element] : elements) {
    catalogue.objects_.push_back(element.as(address, objects[address.index].name));
  }
  catalogue.sort();
  if (catalogue.objects_.empty()) {
    throw HostError("no object is described there", file, "give an EDS or DCF file with --eds");
  }
  return catalogue;
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

ObjectAddress ObjectCatalogue::resolve(std::string_view text) const {
  if (const auto address = parse_address(text)) return *address;
  const std::string wanted = plain(text);
  const NamedObject* found = nullptr;
  bool in_parts = false;
  for (const NamedObject& object : objects_) {
    const bool simple = object.address.sub == 0 && object.name == object.object_name;
    const std::string full = plain(object.object_name) + "." + plain(object.name);
    if ((simple && plain(object.name) == wanted) || full == wanted) {
      if (found == nullptr) found = &object;
    }
    in_parts = in_parts || (!simple && plain(object.object_name) == wanted);
  }
  if (found != nullptr) return found->address;
  const std::string where = fmt::format("object \"{}\"", text);
  if (in_parts) throw HostError("it has sub-indices", where, "write INDEX:SUB, or OBJECT.NAME of the sub-index");
  throw HostError("no object has this name", where,
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
    if (one.type == type) shortest = one.word;  // the long one comes first
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
    return fmt::format("\"{}\"", text.substr(0, text.find_last_not_of('\0') + 1));
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
    if (digits.size() % 2 != 0) refuse_value(text, "an odd number of hexadecimal digits is no whole bytes");
    for (std::size_t i = 0; i < digits.size(); i += 2) {
      unsigned byte = 0;
      const auto [end, error] = std::from_chars(&digits[i], &digits[i] + 2, byte, 16);
      if (error != std::errc{} || end != &digits[i] + 2) refuse_value(text, "bytes are written in hexadecimal");
      bytes.push_back(static_cast<std::byte>(byte));
    }
    return bytes;
  }
  if (type == Type::real32) {
    float number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc{} || end != text.data() + text.size()) refuse_value(text, "it is no number");
    return bytes_of(&number, sizeof number);
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
  std::uint64_t magnitude = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), magnitude, base);
  if (digits.empty() || error != std::errc{} || end != digits.data() + digits.size()) {
    refuse_value(text, "it is no whole number");
  }
  // Hexadecimal gives the bits; decimal gives the number, which must be one the type has.
  const unsigned bits = static_cast<unsigned>(size * 8);
  const std::uint64_t all_ones = ~std::uint64_t{0} >> (64 - bits);
  const std::uint64_t highest = type == Type::boolean                       ? 1
                                : dictionary::is_signed(type) && base == 10 ? all_ones >> 1
                                                                            : all_ones;
  const std::uint64_t lowest = dictionary::is_signed(type) ? (all_ones >> 1) + 1 : 0;
  if (magnitude > (negative ? lowest : highest)) {
    refuse_value(text, fmt::format("it is outside the type, {}{} .. {}", lowest != 0 ? "-" : "", lowest, highest));
  }
  const std::uint64_t value = negative ? ~magnitude + 1 : magnitude;
  return bytes_of(&value, size);
}

}  // namespace servodrome::host
