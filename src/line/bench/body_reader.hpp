#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "line/bench/error.hpp"

namespace servodrome::line::bench {

// The JSON object in a request's body, read key by key: wrong types and ranges, and in `finish` keys not asked for,
// are thrown as ApiError.
class BodyReader {
 public:
  // Throws unless the body is an object. `empty_is_object`: no body at all counts as {}.
  explicit BodyReader(const std::string& body, bool empty_is_object = false);
  // An object within one. Throws unless it is an object.
  explicit BodyReader(const Json& part);

  bool has(std::string_view key);
  std::optional<double> number(std::string_view key, double minimum = -std::numeric_limits<double>::max(),
                               double maximum = std::numeric_limits<double>::max());
  std::optional<std::uint64_t> integer(std::string_view key, std::uint64_t maximum);
  std::optional<std::int64_t> signed_integer(std::string_view key);
  std::optional<bool> boolean(std::string_view key);
  std::optional<std::string> string(std::string_view key);
  // The value under the key, or a refusal that says it is missing.
  const Json& required(std::string_view key);

  const Json& object() const { return json_; }
  void finish() const;

 private:
  const Json* find(std::string_view key);
  [[noreturn]] void wrong_type(std::string_view key, const Json& value, std::string_view expected) const;

  Json json_;
  std::vector<std::string_view> known_;
};

}  // namespace servodrome::line::bench
