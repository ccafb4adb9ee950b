#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "modbus/character_format.hpp"

namespace servodrome::links {

// Reads "8N1": data bits (7 or 8), parity N, E or O, stop bits (1 or 2). Returns nothing if `text` is no such format.
std::optional<modbus::CharacterFormat> parse_character_format(std::string_view text, std::uint32_t bit_rate);

// Returns the format as parse_character_format() reads it, without the bit rate.
std::string to_string(const modbus::CharacterFormat& format);

}  // namespace servodrome::links
