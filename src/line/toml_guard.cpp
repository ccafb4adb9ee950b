#include "line/toml_guard.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace servodrome::line {
namespace {

constexpr std::size_t most_key_parts = 16;

// Returns the end of the string or comment that begins at `at`, or `at` itself if none begins there.
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
      return i;  // an error, which the TOML library reports
    }
  }
  return text.size();
}

bool begins_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
         c == '"' || c == '\'';
}

// `at` is behind the first bracket of a line.
bool is_table_without_name(std::string_view text, std::size_t at) {
  if (at < text.size() && text[at] == '[') ++at;
  at = std::min(text.find_first_not_of(" \t", at), text.size());
  // toml++ itself detects a header that ends here or has empty brackets.
  return at < text.size() && text[at] != ']' && text[at] != '\n' && text[at] != '\r' && !begins_name(text[at]);
}

std::size_t line_of(std::string_view text, std::size_t at) {
  return static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n')) + 1;
}

}  // namespace

std::optional<TomlRefusal> refuse_toml(std::string_view text) {
  std::size_t dots = 0;
  std::size_t depth = 0;  // of brackets; inside them, a bracket at the beginning of a line belongs to a list
  bool line_begins = true;
  for (std::size_t i = 0; i < text.size();) {
    if (const std::size_t end = end_of_text(text, i); end != i) {
      i = end;
      line_begins = false;
      continue;
    }
    const char c = text[i++];
    if (c == '.' && ++dots >= most_key_parts) {
      return TomlRefusal{line_of(text, i), "a key has too many parts",
                         fmt::format("write at most {} names with dots between them", most_key_parts)};
    }
    if (c == '[' && line_begins && depth == 0 && is_table_without_name(text, i)) {
      return TomlRefusal{line_of(text, i), "a table has no name", "write [name] or [[name]]"};
    }
    if (c == '[') ++depth;
    if (c == ']' && depth > 0) --depth;
    if (c == '\n' || c == ',' || c == '=' || c == '[' || c == '{') dots = 0;
    line_begins = c == '\n' || (line_begins && (c == ' ' || c == '\t' || c == '\r'));
  }
  return std::nullopt;
}

}  // namespace servodrome::line
