#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace servodrome::line {

// The reason why a text must not be passed to the TOML library, and the line (from 1) where it occurs.
struct TomlRefusal {
  std::size_t line;
  std::string what;
  std::string hint;
};

// Detects texts that toml++ 3.3 cannot handle safely. The library makes a nested table for each part of a dotted key
// and recurses into all of them, so a long key overflows the stack. It limits the depth of brackets itself. It also
// assumes that a name follows the brackets of a table header. Where it skips blanks, it assumes that no letter from
// U+00A1 to U+0499 follows, and some others. Where it looks for a value, it assumes that no bracket closes another one.
std::optional<TomlRefusal> refuse_toml(std::string_view text);

}  // namespace servodrome::line
