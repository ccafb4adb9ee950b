#include "api/body_reader.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <set>

#include "links/nearest_name.hpp"

namespace servodrome::api {
namespace {

// Shortens a value for a message.
std::string excerpt(const Json& value) {
  constexpr std::size_t longest = 40;
  if (value.is_structured()) return value.is_array() ? "an array" : "an object";
  std::string text = to_text(value);
  return text.size() <= longest ? text : text.substr(0, longest) + "...";
}

constexpr double unlimited = std::numeric_limits<double>::max();

std::string range_text(double minimum, double maximum) {
  if (minimum == -unlimited) return fmt::format("a number of at most {}", maximum);
  if (maximum == unlimited) return fmt::format("a number of at least {}", minimum);
  return fmt::format("a number from {} to {}", minimum, maximum);
}

// Limits the nesting: copying, printing and destroying nested values uses stack for each level.
constexpr int deepest_body = 32;

bool nests_deeper_than(int most, std::string_view text) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      if (c == '"') quoted = false;
    } else if (c == '"') {
      quoted = true;
    } else if (c == '[' || c == '{') {
      if (++depth > most) return true;
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  return false;
}

// Parses a text, and throws if an object has a key twice: which of the two values counts is not defined (RFC 8259 4).
Json parse_once(const std::string& text) {
  std::vector<std::set<std::string>> open;  // the keys of each object that is not complete yet
  std::string twice;
  Json parsed = Json::parse(text, [&](int, Json::parse_event_t event, Json& part) {
    if (event == Json::parse_event_t::object_start) open.emplace_back();
    if (event == Json::parse_event_t::object_end) open.pop_back();
    if (event == Json::parse_event_t::key && !open.back().insert(part.get<std::string>()).second) {
      twice = part.get<std::string>();
    }
    return true;
  });
  if (!twice.empty()) {
    throw ApiError{400, fmt::format("the key \"{}\" is there twice", twice), "body", "send each key once"};
  }
  return parsed;
}

}  // namespace

BodyReader::BodyReader(std::string where, const Json& part) : json_(part), where_(std::move(where)) {
  if (!json_.is_object()) {
    throw ApiError{400, fmt::format("{} was sent instead of an object", excerpt(json_)), where_,
                   "docs/bench-api.md has examples"};
  }
}

BodyReader::BodyReader(const std::string& body, bool empty_is_object) {
  if (body.empty() && empty_is_object) {
    json_ = Json::object();
    return;
  }
  if (nests_deeper_than(deepest_body, body)) {
    throw ApiError{400, fmt::format("the body is nested deeper than {} levels", deepest_body), "body",
                   "send an object such as {\"value\": 1}"};
  }
  try {
    json_ = parse_once(body);
  } catch (const nlohmann::json::parse_error& error) {
    throw ApiError{400, "the body is not JSON", fmt::format("body, byte {}", error.byte),
                   "send an object such as {\"value\": 1}"};
  } catch (const nlohmann::json::exception&) {
    throw ApiError{400, "the body contains a number that is too large", "body",
                   "send an object such as {\"value\": 1}"};
  }
  if (!json_.is_object()) {
    throw ApiError{400, fmt::format("the body is {}", excerpt(json_)), "body", "send an object such as {\"value\": 1}"};
  }
}

const Json* BodyReader::find(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  const auto found = json_.find(std::string(key));
  return found == json_.end() ? nullptr : &*found;
}

bool BodyReader::has(std::string_view key) { return find(key) != nullptr; }

void BodyReader::refuse(unsigned status, std::string_view key, const Json& value, const std::string& hint) const {
  throw ApiError{status, fmt::format("{} is {}", key, excerpt(value)),
                 where_ == whole_body ? std::string(key) : fmt::format("{}.{}", where_, key), "send " + hint};
}

std::optional<double> BodyReader::number(std::string_view key, double minimum, double maximum) {
  const Json* value = find(key);
  if (value == nullptr) return std::nullopt;
  if (!value->is_number()) refuse(400, key, *value, "a number");
  const double number = value->get<double>();
  if (!(number >= minimum && number <= maximum)) refuse(422, key, *value, range_text(minimum, maximum));
  return number;
}

std::optional<std::uint64_t> BodyReader::integer(std::string_view key, std::uint64_t maximum) {
  const Json* value = find(key);
  if (value == nullptr) return std::nullopt;
  if (!value->is_number_integer()) refuse(400, key, *value, "an integer");
  if (!value->is_number_unsigned() || value->get<std::uint64_t>() > maximum) {
    refuse(422, key, *value, fmt::format("an integer from 0 to {}", maximum));
  }
  return value->get<std::uint64_t>();
}

std::optional<std::int64_t> BodyReader::signed_integer(std::string_view key) {
  const Json* value = find(key);
  if (value == nullptr) return std::nullopt;
  if (!value->is_number_integer()) refuse(400, key, *value, "an integer");
  if (value->is_number_unsigned() && value->get<std::uint64_t>() > INT64_MAX) {
    refuse(422, key, *value, "an integer of 64 bits with sign");
  }
  return value->get<std::int64_t>();
}

std::optional<bool> BodyReader::boolean(std::string_view key) {
  const Json* value = find(key);
  if (value == nullptr) return std::nullopt;
  if (!value->is_boolean()) refuse(400, key, *value, "true or false");
  return value->get<bool>();
}

std::optional<std::string> BodyReader::string(std::string_view key) {
  const Json* value = find(key);
  if (value == nullptr) return std::nullopt;
  if (!value->is_string()) refuse(400, key, *value, "a string");
  return value->get<std::string>();
}

const Json& BodyReader::required(std::string_view key) {
  const Json* value = find(key);
  if (value == nullptr) {
    throw ApiError{400, fmt::format("{} is missing", key), where_, fmt::format("send {{\"{}\": ...}}", key)};
  }
  return *value;
}

void BodyReader::finish() const {
  for (const auto& [key, value] : json_.items()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    throw ApiError{400, fmt::format("unknown key \"{}\"", key.substr(0, 40)), where_, links::suggestion(key, known_)};
  }
}

}  // namespace servodrome::api
