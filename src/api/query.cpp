#include "api/query.hpp"

#include <algorithm>
#include <charconv>
#include <fmt/format.h>

#include "links/nearest_name.hpp"
#include "links/number_text.hpp"

namespace servodrome::api {
namespace {

struct Pair {
  std::string_view key;
  std::string_view value;
};

// Removes the first pair from `query`, which is not empty.
Pair next_pair(std::string_view& query) {
  const std::string_view pair = query.substr(0, query.find('&'));
  query.remove_prefix(std::min(pair.size() + 1, query.size()));
  const std::size_t equals = std::min(pair.find('='), pair.size());
  return {pair.substr(0, equals), pair.substr(std::min(equals + 1, pair.size()))};
}

template <typename T>
std::optional<T> number_in_query(const Call& call, std::string_view key, T least, T most, std::string_view expected) {
  const auto text = query_value(call, key);
  if (!text) return std::nullopt;
  const auto number = links::number_of_text<T>(*text);
  if (number && *number >= least && *number <= most) return number;
  throw ApiError{number ? 422U : 400U, fmt::format("{} is \"{}\"", key, text->substr(0, 40)), std::string(key),
                 fmt::format("write {} from {} to {}", expected, least, most)};
}

}  // namespace

std::string unescaped(std::string_view text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned byte = 0;
    if (text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(&text[i + 1], &text[i + 3], byte, 16).ptr == &text[i + 3]) {
      plain += static_cast<char>(byte);
      i += 2;
    } else {
      plain += text[i] == '+' ? ' ' : text[i];
    }
  }
  return plain;
}

std::optional<std::string> query_value(const Call& call, std::string_view key) {
  for (std::string_view rest = call.query; !rest.empty();) {
    const Pair pair = next_pair(rest);
    if (pair.key == key) return unescaped(pair.value);
  }
  return std::nullopt;
}

bool query_flag(const Call& call, std::string_view key) {
  const auto value = query_value(call, key);
  if (!value || value == "false") return false;
  if (value == "true") return true;
  throw ApiError{400, fmt::format("{} is \"{}\"", key, value->substr(0, 40)), std::string(key),
                 fmt::format("write {}=true, or leave it out", key)};
}

std::optional<std::uint64_t> query_integer(const Call& call, std::string_view key, std::uint64_t least,
                                           std::uint64_t most) {
  return number_in_query(call, key, least, most, "a whole number");
}

std::optional<double> query_number(const Call& call, std::string_view key, double least, double most) {
  return number_in_query(call, key, least, most, "a number");
}

void require_query_keys(std::string_view query, std::string_view keys) {
  std::vector<std::string_view> known;
  while (!keys.empty()) known.push_back(next_pair(keys).key);
  while (!query.empty()) {
    const std::string_view key = next_pair(query).key;
    if (key.empty() || std::find(known.begin(), known.end(), key) != known.end()) continue;
    throw ApiError{400, fmt::format("unknown key \"{}\" in the query", unescaped(key.substr(0, 40))), "address",
                   known.empty() ? "this address has no query: leave it out" : links::suggestion(key, known)};
  }
}

}  // namespace servodrome::api
