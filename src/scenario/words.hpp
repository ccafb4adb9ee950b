#pragma once

#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "line/table_reader.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::scenario {

// A word of the scenario file and its value.
template <typename Value>
struct Word {
  std::string_view name;
  Value value;
};

template <typename Value, std::size_t Count>
std::string_view word_of(const std::array<Word<Value>, Count>& words, Value value) {
  for (const auto& word : words) {
    if (word.value == value) return word.name;
  }
  return "?";
}

// Reads a key whose value is one of `words`. Reports an error for any other value.
template <typename Value, std::size_t Count>
std::optional<Value> read_word(line::TableReader& reader, std::string_view key,
                               const std::array<Word<Value>, Count>& words) {
  std::vector<std::string_view> names;
  for (const auto& word : words) names.push_back(word.name);
  reader.note_words(key, names);
  std::string text;
  reader.read(key, text);
  if (text.empty()) return std::nullopt;
  for (const auto& word : words) {
    if (word.name == text) return word.value;
  }
  reader.complain(key, fmt::format("there is no \"{}\"", text), links::suggestion(text, names));
  return std::nullopt;
}

}  // namespace servodrome::scenario
