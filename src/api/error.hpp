#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "api/http.hpp"
#include "dictionary/abort_code.hpp"

namespace servodrome::api {

using Json = nlohmann::ordered_json;  // keys stay in the order of insertion

// An error response, thrown by a handler. Handlers change nothing before the last place where they may throw.
struct ApiError {
  unsigned status = 400;
  std::string what;
  std::string where;
  std::string hint;
  dictionary::AbortCode abort = dictionary::AbortCode::none;  // of the drive, if it refused access
};

// Returns {"error": {"what", "where", "hint"}}, with "abort" and "abort_text" if the drive refused access.
Response error_response(const ApiError& error);

// Returns a value as JSON text; bytes that are not UTF-8 become U+FFFD.
std::string to_text(const Json& json);

}  // namespace servodrome::api
