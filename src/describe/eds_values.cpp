#include "describe/eds_values.hpp"

#include <algorithm>
#include <array>
#include <charconv>

#include "describe/eds_sections.hpp"

namespace servodrome::describe::eds_file {

using dictionary::Type;

std::optional<std::uint32_t> bytes_of_other_type(std::int64_t number) {
  switch (number) {
    case 0x0B: return 0U;  // UNICODE_STRING
    case 0x0C:
    case 0x0D: return 6U;  // TIME_OF_DAY, TIME_DIFFERENCE
    case 0x10:
    case 0x16: return 3U;
    case 0x11: return 8U;  // REAL64
    case 0x12:
    case 0x18: return 5U;
    case 0x13:
    case 0x19: return 6U;
    case 0x14:
    case 0x1A: return 7U;
    default: return std::nullopt;
  }
}

std::optional<Type> type_of(std::int64_t number) {
  switch (number) {
    case 0x1E: return Type::unsigned8;  // BYTE, WORD, DWORD of ETG.1020
    case 0x1F: return Type::unsigned16;
    case 0x20: return Type::unsigned32;
    default: break;
  }
  constexpr auto types =
      std::to_array({Type::boolean, Type::integer8, Type::integer16, Type::integer32, Type::unsigned8, Type::unsigned16,
                     Type::unsigned32, Type::real32, Type::visible_string, Type::octet_string, Type::domain,
                     Type::integer64, Type::unsigned64});
  for (const Type type : types) {
    if (number == static_cast<std::int64_t>(type)) return type;
  }
  return std::nullopt;
}

std::int64_t of_type(Type type, std::int64_t value) {
  const unsigned bits = dictionary::size_of(type) * 8U;
  if (!dictionary::is_signed(type) || bits == 64 || value <= dictionary::maximum_of(type)) return value;
  if (value >> bits != 0) return value;
  return value - (std::int64_t{1} << bits);
}

std::string octets(std::string_view text) {
  std::string bytes;
  std::string digits;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    std::string_view word = rest.substr(0, end);
    rest = trim(rest.substr(end));
    if (word.starts_with("0x") || word.starts_with("0X")) word.remove_prefix(2);
    digits += word;
  }
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    unsigned byte = 0;
    const auto [end, error] = std::from_chars(&digits[i], &digits[i] + 2, byte, 16);
    if (error != std::errc{} || end != &digits[i] + 2) return std::string(text);
    bytes += static_cast<char>(byte);
  }
  return digits.size() % 2 == 0 ? bytes : std::string(text);
}

}  // namespace servodrome::describe::eds_file
