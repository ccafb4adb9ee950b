#include "line/toml_depth.hpp"

#include <algorithm>
#include <string>

namespace servodrome::line {
namespace {

// Where the string or comment that begins at `at` ends; `at` itself if none does.
std::size_t end_of_text(std::string_view text, std::size_t at) {
  const char quote = text[at];
  if (quote == '#') return std::min(text.find('\n', at), text.size());
  if (quote != '"' && quote != '\'') return at;
  const bool of_lines = text.substr(at, 3) == std::string(3, quote);
  const std::string_view mark = text.substr(at, of_lines ? 3 : 1);
  for (std::size_t i = at + mark.size(); i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
    } else if (text.substr(i, mark.size()) == mark) {
      return i + mark.size();
    } else if (text[i] == '\n' && !of_lines) {
      return i;  // a mistake that the TOML library will name
    }
  }
  return text.size();
}

}  // namespace

std::size_t line_with_deep_key(std::string_view text) {
  std::size_t dots = 0;
  for (std::size_t i = 0; i < text.size();) {
    if (const std::size_t end = end_of_text(text, i); end != i) {
      i = end;
      continue;
    }
    const char c = text[i++];
    if (c == '.' && ++dots >= most_key_parts) {
      return static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(i), '\n')) +
             1;
    }
    if (c == '\n' || c == ',' || c == '=' || c == '[' || c == '{') dots = 0;
  }
  return 0;
}

}  // namespace servodrome::line
