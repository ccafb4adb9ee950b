#pragma once

#include <cstddef>
#include <string_view>

namespace servodrome::line {

// A dotted key makes a table within a table for each of its parts, and the TOML library goes down into all of them on
// the stack; of brackets it counts how deep they are itself.
inline constexpr std::size_t most_key_parts = 16;

// The line of a TOML text where a key has more parts than that; 0: nowhere.
std::size_t line_with_deep_key(std::string_view text);

}  // namespace servodrome::line
