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

// Detects texts that toml++ 3.3 cannot handle safely, and returns the first such place; nullopt: the text is safe.
// - A dotted key with many parts: the library makes a nested table for each part and recurses into all of them, so a
//   long key overflows the stack. (The library itself limits the depth of brackets.)
// - A table header without a name: the library assumes that a name follows the brackets.
// - A letter that is not ASCII outside of strings: where the library skips blanks, it assumes that none of the letters
//   U+00A1 to U+0499, and none of some others, follows.
// - A closing bracket without its opening bracket: where the library looks for a value, it assumes that none comes.
// - A quote within a word: the library continues the word through the quotes.
std::optional<TomlRefusal> refuse_toml(std::string_view text);

}  // namespace servodrome::line
