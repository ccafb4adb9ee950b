#include "tools/script/words.hpp"

#include <charconv>
#include <cmath>
#include <fmt/format.h>

namespace servodrome::master::script {
namespace {

constexpr double longest_s = 1e6;

}  // namespace

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\r";
  const std::size_t first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

std::string shown(std::string_view word) {
  std::string text;
  for (const char character : word.substr(0, 40)) {
    const auto byte = static_cast<unsigned char>(character);
    text += byte >= 0x20 && byte != 0x7F ? character : '?';
  }
  return text;
}

std::vector<Word> words_of(std::string_view line, std::size_t& end) {
  std::vector<Word> words;
  std::size_t at = 0;
  for (;;) {
    while (at < line.size() && (line[at] == ' ' || line[at] == '\t' || line[at] == '\r')) ++at;
    end = at;
    if (at == line.size() || line[at] == '#') return words;
    Word word{.text = {}, .column = static_cast<unsigned>(at + 1)};
    if (line[at] == '"') {
      const std::size_t close = line.find('"', at + 1);
      if (close == std::string_view::npos) throw LineMistake{word.column, "a quote that does not end"};
      word.text = line.substr(at + 1, close - at - 1);
      word.quoted = true;
      at = close + 1;
    } else {
      const std::size_t start = at;
      while (at < line.size() && line[at] != ' ' && line[at] != '\t' && line[at] != '\r' && line[at] != '#') ++at;
      word.text = line.substr(start, at - start);
    }
    words.push_back(std::move(word));
  }
}

double number_in(const Word& word, const char* what) {
  double value = 0;
  const char* const end = word.text.data() + word.text.size();
  const char* begin = word.text.data();
  if (word.text.starts_with('+')) ++begin;
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (word.quoted || error != std::errc{} || stop != end || !std::isfinite(value)) {
    throw LineMistake{word.column, fmt::format("\"{}\" is not a number; {} is needed", shown(word.text), what)};
  }
  return value;
}

double seconds(const Word& word) {
  const double value = number_in(word, "a time in seconds");
  if (value < 0 || value > longest_s) {
    throw LineMistake{word.column, fmt::format("{} s is not a time from 0 to {:g} s", value, longest_s)};
  }
  return value;
}

unsigned whole(const Word& word, const char* what, unsigned least, unsigned most) {
  const double value = number_in(word, what);
  if (value != std::floor(value) || value < least || value > most) {
    throw LineMistake{word.column, fmt::format("{} is not {}, {} to {}", shown(word.text), what, least, most)};
  }
  return static_cast<unsigned>(value);
}

}  // namespace servodrome::master::script
