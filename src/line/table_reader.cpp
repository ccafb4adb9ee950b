#include "line/table_reader.hpp"

#include <cmath>
#include <fmt/format.h>

#include "links/nearest_name.hpp"

namespace servodrome::line {
namespace {

std::string_view type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table: return "a table";
    case toml::node_type::array: return "an array";
    case toml::node_type::string: return "a string";
    case toml::node_type::integer: return "an integer";
    case toml::node_type::floating_point: return "a number with a fraction";
    case toml::node_type::boolean: return "true or false";
    default: return "a date or time";
  }
}

}  // namespace

void FileReport::complain(const toml::source_position& at, std::string what, std::string hint) {
  diagnostics.push_back({file, at.line, at.column, std::move(what), std::move(hint)});
}

void FileReport::warn(const toml::source_position& at, std::string what, std::string hint) {
  warnings.push_back({file, at.line, at.column, std::move(what), std::move(hint)});
}

std::string TableReader::name_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

const toml::node* TableReader::node(std::string_view key) {
  known_.emplace(key);
  return table_.get(key);
}

toml::source_position TableReader::place(std::string_view key) const {
  const toml::node* value = table_.get(key);
  return value != nullptr ? value->source().begin : table_.source().begin;
}

void TableReader::complain(std::string_view key, std::string what, std::string hint) {
  report_.complain(place(key), fmt::format("{}: {}", name_of(key), what), std::move(hint));
}

void TableReader::note(KeyNote note) {
  if (report_.notes != nullptr) report_.notes->push_back(std::move(note));
}

void TableReader::note_words(std::string_view key, const std::vector<std::string_view>& words) {
  note({std::string(key), KeyNote::Kind::string, {}, {}, {words.begin(), words.end()}});
}

void TableReader::wrong_type(std::string_view key, const toml::node& node, std::string_view expected) {
  complain(key, fmt::format("is {}", type_name(node)), fmt::format("expected {}", expected));
}

void TableReader::read(std::string_view key, std::string& target) {
  note({std::string(key), KeyNote::Kind::string});
  const toml::node* value = node(key);
  if (value == nullptr) return;
  if (const auto* text = value->as_string()) {
    target = text->get();
  } else {
    wrong_type(key, *value, "a string in quotes");
  }
}

void TableReader::read(std::string_view key, bool& target) {
  note({std::string(key), KeyNote::Kind::boolean});
  const toml::node* value = node(key);
  if (value == nullptr) return;
  if (const auto* flag = value->as_boolean()) {
    target = flag->get();
  } else {
    wrong_type(key, *value, "true or false");
  }
}

void TableReader::read(std::string_view key, double& target) {
  note({std::string(key), KeyNote::Kind::number});
  const toml::node* value = node(key);
  if (value == nullptr) return;
  const auto number = value->is_number() ? value->value<double>() : std::nullopt;
  if (!number) {
    wrong_type(key, *value, "a number");
  } else if (!std::isfinite(*number)) {
    complain(key, "is not finite", "expected a number");
  } else {
    target = *number;
  }
}

void TableReader::read_member(std::string_view key, float& target) {
  double number = static_cast<double>(target);
  read(key, number);
  if (std::abs(number) > static_cast<double>(std::numeric_limits<float>::max())) {
    complain(key, "is too large", "expected a number within 3.4e38");
  } else {
    target = static_cast<float>(number);
  }
}

std::optional<std::int64_t> TableReader::integer(std::string_view key, std::int64_t minimum, std::int64_t maximum) {
  note({std::string(key), KeyNote::Kind::integer, minimum, maximum});
  const toml::node* value = node(key);
  if (value == nullptr) return std::nullopt;
  const auto* number = value->as_integer();
  if (number == nullptr) {
    wrong_type(key, *value, "an integer");
    return std::nullopt;
  }
  if (number->get() < minimum || number->get() > maximum) {
    complain(key, fmt::format("{} is out of range", number->get()), fmt::format("expected {} .. {}", minimum, maximum));
    return std::nullopt;
  }
  return number->get();
}

const toml::table* TableReader::table(std::string_view key, std::string_view definition) {
  note({std::string(key), KeyNote::Kind::table, {}, {}, {}, std::string(definition)});
  const toml::node* value = node(key);
  if (value == nullptr) return nullptr;
  if (!value->is_table()) wrong_type(key, *value, fmt::format("a table [{}]", key));
  return value->as_table();
}

std::vector<const toml::table*> TableReader::tables(std::string_view key, std::string_view definition) {
  note({std::string(key), KeyNote::Kind::tables, {}, {}, {}, std::string(definition)});
  std::vector<const toml::table*> result;
  const toml::node* value = node(key);
  if (value == nullptr) return result;
  const toml::array* array = value->as_array();
  if (array == nullptr) {
    wrong_type(key, *value, fmt::format("tables [[{}]]", key));
    return result;
  }
  for (const toml::node& element : *array) {
    if (const toml::table* one = element.as_table()) {
      result.push_back(one);
    } else {
      report_.complain(element.source().begin, fmt::format("{}: is {}", name_of(key), type_name(element)),
                       fmt::format("expected tables [[{}]]", key));
    }
  }
  return result;
}

void TableReader::finish() {
  const std::vector<std::string_view> names(known_.begin(), known_.end());
  for (const auto& [key, value] : table_) {
    if (known_.contains(key.str())) continue;
    report_.complain(key.source().begin,
                     path_.empty() ? fmt::format("unknown key `{}`", key.str())
                                   : fmt::format("unknown key `{}` in {}", key.str(), path_),
                     links::suggestion(key.str(), names));
  }
}

}  // namespace servodrome::line
