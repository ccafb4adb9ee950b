#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "api/routes.hpp"

// Reads the query of a request, the part of its address behind the ?. `Route::pattern` names the keys; a request with
// another key is refused before its handler runs. All functions throw ApiError for a value of another form or range.
namespace servodrome::api {

// Returns the value of a key, decoded: for "?after=12" the value of "after" is "12". Returns nothing if the key is not
// there.
std::optional<std::string> query_value(const Call& call, std::string_view key);
// A flag: absent or "false" is false, "true" is true.
bool query_flag(const Call& call, std::string_view key);
// A whole number in least .. most.
std::optional<std::uint64_t> query_integer(const Call& call, std::string_view key, std::uint64_t least,
                                           std::uint64_t most);
// A number in least .. most.
std::optional<double> query_number(const Call& call, std::string_view key, double least, double most);

// Refuses a query with a key that is not in `keys`, which are separated by & as in a pattern.
void require_query_keys(std::string_view query, std::string_view keys);

// Decodes an argument or a value of the query: %XX becomes a byte, + becomes a space.
std::string unescaped(std::string_view text);

}  // namespace servodrome::api
