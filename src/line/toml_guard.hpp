#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace servodrome::line {

// Why a text is not handed to the TOML library, and where.
struct TomlRefusal {
  std::size_t line;
  std::string what;
  std::string hint;
};

// What toml++ 3.3 cannot be given, whatever it is: a dotted key makes a table within a table for each of its parts, and
// it goes down into all of them on the stack (of brackets it counts how deep they are itself); and it takes for granted
// that a name begins behind the brackets of a table.
std::optional<TomlRefusal> refuse_toml(std::string_view text);

}  // namespace servodrome::line
