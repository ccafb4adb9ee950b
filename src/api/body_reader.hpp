#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/error.hpp"

namespace servodrome::api {

// Reads the JSON object in a request's body key by key. Throws ApiError for a wrong type or a value out of range, and
// in `finish` for keys that no call asked for.
class BodyReader {
 public:
  // Throws unless the body is a JSON object. With `empty_is_object` an empty body counts as {}.
  explicit BodyReader(const std::string& body, bool empty_is_object = false);
  // Reads an object within another; `where` names it in errors, such as "trigger". Throws unless `part` is an object.
  BodyReader(std::string where, const Json& part);

  bool has(std::string_view key);
  std::optional<double> number(std::string_view key, double minimum = -std::numeric_limits<double>::max(),
                               double maximum = std::numeric_limits<double>::max());
  std::optional<std::uint64_t> integer(std::string_view key, std::uint64_t maximum);
  std::optional<std::int64_t> signed_integer(std::string_view key);
  std::optional<bool> boolean(std::string_view key);
  std::optional<std::string> string(std::string_view key);
  // Returns the value of the key. Throws ApiError if the key is missing.
  const Json& required(std::string_view key);

  const Json& object() const { return json_; }
  void finish() const;

 private:
  static constexpr const char* whole_body = "body";
  const Json* find(std::string_view key);
  [[noreturn]] void refuse(unsigned status, std::string_view key, const Json& value, const std::string& hint) const;

  Json json_;
  std::string where_ = whole_body;
  std::vector<std::string_view> known_;
};

}  // namespace servodrome::api
