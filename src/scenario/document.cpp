#include "scenario/document.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "line/toml_text.hpp"

namespace servodrome::scenario {
namespace {

std::string key_text(std::string_view key) {
  const auto is_bare = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  const bool bare = !key.empty() && std::all_of(key.begin(), key.end(), is_bare);
  return bare ? std::string(key) : line::toml_quoted(key);
}

std::string value_text(const toml::node& node) {
  std::string text;
  if (const toml::table* table = node.as_table()) {
    for (const std::string_view key : keys_in_order(*table)) {
      text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", key_text(key), value_text(*table->get(key)));
    }
    return text.empty() ? "{}" : fmt::format("{{ {} }}", text);
  }
  if (const toml::array* array = node.as_array()) {
    for (const toml::node& value : *array) text += fmt::format("{}{}", text.empty() ? "" : ", ", value_text(value));
    return fmt::format("[{}]", text);
  }
  if (const auto string = node.value_exact<std::string_view>()) return line::toml_quoted(*string);
  std::ostringstream stream;
  node.visit([&stream](const auto& value) { stream << value; });
  return stream.str();
}

std::string lines_of(const toml::table& table) {
  std::string lines;
  for (const std::string_view key : keys_in_order(table)) {
    lines += fmt::format("{} = {}\n", key_text(key), value_text(*table.get(key)));
  }
  return lines;
}

bool has_headings(const toml::node& node) {
  const toml::array* array = node.as_array();
  return array != nullptr && !array->empty() && array->is_homogeneous<toml::table>();
}

}  // namespace

toml::table table_of(std::string_view text, const std::string& file) {
  std::vector<line::Diagnostic> diagnostics;
  std::optional<toml::table> table = line::parse_toml(text, file, diagnostics);
  if (!table) throw std::runtime_error(to_string(diagnostics.front()));
  return std::move(*table);
}

// The library sorts keys by name. A node that was not read from a file has line 0.
std::vector<std::string_view> keys_in_order(const toml::table& table) {
  std::vector<std::string_view> keys;
  for (const auto& [key, node] : table) keys.push_back(key.str());
  const auto place = [&table](std::string_view key) {
    const toml::source_position begin = table.get(key)->source().begin;
    return std::pair(begin.line, begin.column);
  };
  std::stable_sort(keys.begin(), keys.end(),
                   [&place](std::string_view a, std::string_view b) { return place(a) < place(b); });
  return keys;
}

std::vector<toml::table*> tables_at(toml::table& document, std::string_view key) {
  std::vector<toml::table*> tables;
  toml::array* array = document[key].as_array();
  for (std::size_t i = 0; array != nullptr && i < array->size(); ++i) {
    if (toml::table* table = array->get_as<toml::table>(i)) tables.push_back(table);
  }
  return tables;
}

std::string text_of(const toml::table& document) {
  std::string values;
  std::string headings;
  for (const std::string_view key : keys_in_order(document)) {
    const toml::node& node = *document.get(key);
    if (!has_headings(node)) {
      values += fmt::format("{} = {}\n", key_text(key), value_text(node));
      continue;
    }
    for (const toml::node& one : *node.as_array()) {
      headings += fmt::format("\n[[{}]]\n{}", key_text(key), lines_of(*one.as_table()));
    }
  }
  return values + headings;
}

}  // namespace servodrome::scenario
