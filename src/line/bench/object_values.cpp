#include "line/bench/object_values.hpp"

#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <limits>

#include "describe/words.hpp"
#include "drive/drive.hpp"
#include "line/bench/object_words.hpp"
#include "links/number_text.hpp"

namespace servodrome::line::bench {
namespace {

using dictionary::AbortCode;
using dictionary::Entry;
using dictionary::Type;

// Reads an index or sub-index in hexadecimal, with or without 0x.
unsigned hexadecimal(std::string_view text, unsigned maximum, std::string_view what) {
  std::string_view digits = text;
  if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
  const auto value = links::number_of_text<unsigned>(digits, 16);
  if (!value || *value > maximum) {
    throw ApiError{400, fmt::format("\"{}\" is not {}", text.substr(0, 40), what), "address",
                   "write index and sub-index in hexadecimal: objects/6041/0"};
  }
  return *value;
}

std::string hex_of(std::span<const std::byte> bytes) {
  std::string text;
  text.reserve(bytes.size() * 2);
  for (const std::byte byte : bytes) text += fmt::format("{:02x}", static_cast<unsigned>(byte));
  return text;
}

Json value_of(const Entry& entry, std::span<const std::byte> bytes) {
  switch (entry.type) {
    case Type::visible_string: return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    case Type::octet_string:
    case Type::domain: return hex_of(bytes);
    case Type::real32: {
      const auto number = std::bit_cast<float>(static_cast<std::uint32_t>(decode_number(Type::unsigned32, bytes)));
      return std::isfinite(number) ? Json(number) : Json(nullptr);  // JSON has no infinity
    }
    case Type::unsigned64: return static_cast<std::uint64_t>(decode_number(entry.type, bytes));
    default: return decode_number(entry.type, bytes);
  }
}

Json describe(const Entry& entry) {
  return Json{{"index", fmt::format("0x{:04X}", entry.index)},
              {"sub", entry.sub},
              {"name", entry.name},
              {"type", describe::word(entry.type)},
              {"access", describe::word(entry.access)},
              {"unit", entry.unit}};
}

// The object to which a value will be written.
struct Place {
  const Entry& entry;
  const std::string& where;
};

[[noreturn]] void wrong_value(const Place& object, std::string_view expected) {
  throw ApiError{400, "the value has the wrong type", object.where,
                 fmt::format("{} takes {}", describe::word(object.entry.type), expected)};
}

// The value cannot be sent. The range of the drive may be narrower; the drive itself checks it.
[[noreturn]] void outside_type(const Place& object, AbortCode abort) {
  const Type type = object.entry.type;
  std::string lowest = fmt::format("{}", dictionary::minimum_of(type));
  std::string highest = fmt::format("{}", dictionary::maximum_of(type));
  if (type == Type::unsigned64) highest = fmt::format("{}", std::numeric_limits<std::uint64_t>::max());
  if (type == Type::real32) {
    highest = fmt::format("{:g}", std::numeric_limits<float>::max());
    lowest = "-" + highest;
  }
  throw ApiError{422, fmt::format("the value is outside {}, {} .. {}", describe::word(type), lowest, highest),
                 object.where, "give a value of the object's type", abort};
}

using Bytes = std::vector<std::byte>;

Bytes bytes_of_hex(const Place& object, const std::string& text) {
  Bytes bytes;
  if (text.size() % 2 != 0) wrong_value(object, "two hexadecimal digits for each byte, as a string");
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const auto byte = links::number_of_text<std::uint8_t>(std::string_view(text).substr(i, 2), 16);
    if (!byte) wrong_value(object, "two hexadecimal digits for each byte, as a string");
    bytes.push_back(static_cast<std::byte>(*byte));
  }
  return bytes;
}

Bytes bytes_of_number(const Place& object, const Json& value) {
  const Entry& entry = object.entry;
  if (entry.type == Type::real32) {
    if (!value.is_number()) wrong_value(object, "a number");
    const double number = value.get<double>();
    if (std::abs(number) > static_cast<double>(std::numeric_limits<float>::max())) {
      outside_type(object, number > 0 ? AbortCode::value_too_high : AbortCode::value_too_low);
    }
    const auto raw = dictionary::encode_number(std::bit_cast<std::int32_t>(static_cast<float>(number)));
    return {raw.begin(), raw.begin() + 4};
  }
  if (!value.is_number_integer() && !(value.is_boolean() && entry.type == Type::boolean)) {
    wrong_value(object, "an integer");
  }
  std::uint64_t raw_number = 0;
  if (value.is_number_unsigned()) {
    raw_number = value.get<std::uint64_t>();
    const bool any = entry.type == Type::unsigned64;
    if (!any && raw_number > static_cast<std::uint64_t>(dictionary::maximum_of(entry.type))) {
      outside_type(object, AbortCode::value_too_high);
    }
  } else if (value.is_boolean()) {
    raw_number = value.get<bool>() ? 1 : 0;
  } else {
    const auto number = value.get<std::int64_t>();
    if (number < dictionary::minimum_of(entry.type)) outside_type(object, AbortCode::value_too_low);
    raw_number = static_cast<std::uint64_t>(number);
  }
  const auto raw = dictionary::encode_number(static_cast<std::int64_t>(raw_number));
  return {raw.begin(), raw.begin() + dictionary::size_of(entry.type)};
}

Bytes bytes_of(const Place& object, const Json& value) {
  if (object.entry.fixed_size()) return bytes_of_number(object, value);
  if (!value.is_string()) wrong_value(object, "a string");
  const auto& text = value.get_ref<const std::string&>();
  if (object.entry.type != Type::visible_string) return bytes_of_hex(object, text);
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

}  // namespace

ObjectName object_address(std::string_view index, std::string_view sub) {
  return {static_cast<std::uint16_t>(hexadecimal(index, 0xFFFF, "an index")),
          static_cast<std::uint8_t>(hexadecimal(sub, 0xFF, "a sub-index"))};
}

std::vector<std::pair<std::string, ObjectName>> object_list(std::string_view rest) {
  constexpr std::size_t most = 128;
  std::vector<std::pair<std::string, ObjectName>> objects;
  if (rest.empty()) throw ApiError{400, "no objects are named", "objects", "write ?objects=6040:00,6041:00"};
  while (!rest.empty()) {
    const std::string_view text = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(text.size() + 1, rest.size()));
    const std::size_t colon = std::min(text.find(':'), text.size());
    objects.emplace_back(text, object_address(text.substr(0, colon), text.substr(std::min(colon + 1, text.size()))));
    if (objects.size() > most) {
      throw ApiError{400, fmt::format("more than {} objects are named", most), "objects", "ask several times"};
    }
  }
  return objects;
}

void refuse_access(AbortCode abort, std::string where) {
  const auto code = static_cast<std::uint32_t>(abort);
  const bool value = (code & 0xFFFF0000u) == 0x06090000u || (code & 0xFFFF0000u) == 0x06070000u;
  const bool absent = abort == AbortCode::sub_index_does_not_exist || abort == AbortCode::object_does_not_exist;
  throw ApiError{absent  ? 404U
                 : value ? 422U
                         : 409U,
                 fmt::format("the drive refuses: {}", dictionary::text(abort)), std::move(where),
                 "`servodrome export md PRODUCT` describes every object", abort};
}

Json listed(const Entry& entry, products::Device& device, std::string_view product) {
  Json object = describe(entry);
  object["pdo"] = describe::word(entry.pdo);
  object["saved"] = entry.saved;
  if (entry.fixed_size() && entry.type != Type::real32) {
    object["minimum"] = entry.minimum;
    object["maximum"] = entry.maximum;
    object["default"] = dictionary::Dictionary::default_number(entry, device.node_id());
  }
  add_words(object, product, device.drive().policy(), entry);
  return object;
}

Json shown(const Entry& entry, std::span<const std::byte> bytes) {
  Json object = describe(entry);
  object["value"] = value_of(entry, bytes);
  return object;
}

std::vector<std::byte> bytes_of(const Entry& entry, const Json& value, const std::string& where) {
  return bytes_of(Place{entry, where}, value);
}

}  // namespace servodrome::line::bench
