#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "dictionary/entry.hpp"

// Data types and values of an EDS or DCF file.
namespace servodrome::describe::eds_file {

// Size in bytes of values of CiA 301 table 44 and ETG.1020 table 98 whose types a dictionary does not support; 0:
// unknown. Empty for other types.
std::optional<std::uint32_t> bytes_of_other_type(std::int64_t number);

// The dictionary's type with the number of a DataType; empty if the dictionary does not support it.
std::optional<dictionary::Type> type_of(std::int64_t number);

// Hexadecimal limits of a signed type are bit patterns: 0x8000 is the lowest INTEGER16.
std::int64_t of_type(dictionary::Type type, std::int64_t value);

// Reads bytes from "0x01 0x02", "01 02" or plain text.
std::string octets(std::string_view text);

}  // namespace servodrome::describe::eds_file
