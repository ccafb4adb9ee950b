#include "line/toml_guard.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <vector>

namespace servodrome::line {
namespace {

constexpr std::size_t most_key_parts = 16;

bool is_ascii(char c) { return static_cast<unsigned char>(c) < 0x80; }

// Returns the end of the string or comment that begins at `at`, or `at` itself if none begins there.
std::size_t end_of_text(std::string_view text, std::size_t at) {
  const char quote = text[at];
  if (quote == '#') return std::min(text.find('\n', at), text.size());
  if (quote != '"' && quote != '\'') return at;
  const bool of_lines = text.substr(at, 3) == std::string(3, quote);
  const std::string_view mark = text.substr(at, of_lines ? 3 : 1);
  constexpr std::size_t most_quotes_inside = 2;  // at the end of a multi-line string, in front of its mark
  for (std::size_t i = at + mark.size(); i < text.size(); ++i) {
    if (text[i] == '\\' && quote == '"') {
      ++i;
      // The library skips blanks here, and then misinterprets a letter that is not ASCII, as it does outside of
      // strings.
      const std::size_t next = std::min(text.find_first_not_of(" \t\r\n\v\f", i), text.size());
      if (of_lines && next < text.size() && !is_ascii(text[next])) return next;
    } else if (text.substr(i, mark.size()) == mark) {
      std::size_t end = i + mark.size();
      for (std::size_t n = 0; of_lines && n < most_quotes_inside && end < text.size() && text[end] == quote; ++n) ++end;
      return end;
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

// Returns true if the table header has no name. `at` is the offset behind the first bracket of the line.
bool is_table_without_name(std::string_view text, std::size_t at) {
  if (at < text.size() && text[at] == '[') ++at;
  at = std::min(text.find_first_not_of(" \t", at), text.size());
  // toml++ itself detects a header that ends with the text or has empty brackets.
  return at < text.size() && text[at] != ']' && !begins_name(text[at]);
}

std::size_t line_of(std::string_view text, std::size_t at) {
  return static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n')) + 1;
}

// Tracks the brackets and the values of the text, letter by letter, outside of strings and comments.
class Place {
 public:
  bool begins_line() const { return begins_line_; }
  bool is_nested() const { return !brackets_.empty(); }
  // Returns true within a value that is not in quotes. There the library reads until the value ends, also through
  // quotes.
  bool is_within_word() const { return is_within_word_; }
  // Returns false if `c` is a closing bracket, and the innermost open bracket is of another kind or no bracket is open.
  bool may_follow(char c) const {
    if (c != ']' && c != '}') return true;
    return !brackets_.empty() && brackets_.back() == (c == '}');
  }

  void pass_string() { begins_line_ = false; }
  // Processes `c`, for which may_follow() must be true.
  void pass(char c) {
    const bool is_blank = c == ' ' || c == '\t' || c == '\r';
    if (c == '\n' || c == ',' || c == ']' || c == '}' || is_blank) is_within_word_ = false;
    const bool is_header = c == '[' && begins_line_ && brackets_.empty();
    if (is_within_word_) {
      // Within a word a bracket has no meaning.
    } else if (c == '[' || c == '{') {
      is_value_ = c == '[' && !is_header;
      brackets_.push_back(c == '{');
    } else if (c == ']' || c == '}') {
      brackets_.pop_back();
      is_value_ = true;
    } else if (c == '\n' || c == ',') {
      is_value_ = !brackets_.empty() && !brackets_.back();
    } else if (c == '=') {
      is_value_ = true;
    } else if (!is_blank) {
      is_within_word_ = is_value_;
    }
    begins_line_ = c == '\n' || (begins_line_ && is_blank);
  }

 private:
  std::vector<bool> brackets_;  // the open ones; true: of an inline table
  bool begins_line_ = true;
  bool is_value_ = false;  // false: a key or a table header
  bool is_within_word_ = false;
};

}  // namespace

std::optional<TomlRefusal> refuse_toml(std::string_view text) {
  std::size_t dots = 0;
  Place place;
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  for (std::size_t i = text.starts_with(byte_order_mark) ? byte_order_mark.size() : 0; i < text.size();) {
    if (place.is_within_word() && (text[i] == '"' || text[i] == '\'')) {
      return TomlRefusal{line_of(text, i), "a quote stands within a word", "put the whole word in quotes"};
    }
    if (const std::size_t end = end_of_text(text, i); end != i) {
      i = end;
      place.pass_string();
      continue;
    }
    const char c = text[i++];
    if (c == '.' && ++dots >= most_key_parts) {
      return TomlRefusal{line_of(text, i), "a key has too many parts",
                         fmt::format("write at most {} names with dots between them", most_key_parts)};
    }
    // Inside of brackets, a bracket at the beginning of a line belongs to a list.
    if (c == '[' && place.begins_line() && !place.is_nested() && is_table_without_name(text, i)) {
      return TomlRefusal{line_of(text, i), "a table has no name", "write [name] or [[name]]"};
    }
    if (!place.may_follow(c)) {
      return TomlRefusal{line_of(text, i), fmt::format("\"{}\" closes no bracket", c), "correct the brackets"};
    }
    if (!is_ascii(c)) {
      return TomlRefusal{line_of(text, i), "there is a letter that is not ASCII",
                         "write it in quotes, and not behind a backslash"};
    }
    if (c == '\n' || c == ',' || c == '=' || c == '[' || c == '{') dots = 0;
    place.pass(c);
  }
  return std::nullopt;
}

}  // namespace servodrome::line
