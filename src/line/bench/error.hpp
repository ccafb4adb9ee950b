#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "dictionary/abort_code.hpp"
#include "line/bench/http.hpp"

namespace servodrome::line::bench {

using Json = nlohmann::ordered_json;  // keys stay in the order they were written in

// A refusal on its way out of a handler. Handlers change nothing before the last chance to throw one.
struct ApiError {
  unsigned status = 400;
  std::string what;
  std::string where;
  std::string hint;
  dictionary::AbortCode abort = dictionary::AbortCode::none;  // of the drive's service port, if that refused
};

// {"error": {"what", "where", "hint"}}, with "abort" and "abort_text" if the drive refused.
Response error_response(const ApiError& error);

// Text of a value; bytes that are no UTF-8 become U+FFFD.
std::string to_text(const Json& json);

}  // namespace servodrome::line::bench
