#include "links/serial/format_text.hpp"

#include <fmt/format.h>

namespace servodrome::links {
namespace {

constexpr std::string_view parities = "NEO";  // in the order of modbus::Parity

}  // namespace

std::optional<modbus::CharacterFormat> parse_character_format(std::string_view text, std::uint32_t bit_rate) {
  if (text.size() != 3) return std::nullopt;
  const std::size_t parity = parities.find(text[1]);
  if ((text[0] != '7' && text[0] != '8') || parity == std::string_view::npos || (text[2] != '1' && text[2] != '2')) {
    return std::nullopt;
  }
  return modbus::CharacterFormat{.bit_rate = bit_rate,
                                 .data_bits = static_cast<std::uint8_t>(text[0] - '0'),
                                 .parity = static_cast<modbus::Parity>(parity),
                                 .stop_bits = static_cast<std::uint8_t>(text[2] - '0')};
}

std::string to_string(const modbus::CharacterFormat& format) {
  return fmt::format("{}{}{}", format.data_bits, parities[static_cast<std::size_t>(format.parity)], format.stop_bits);
}

}  // namespace servodrome::links
