#include "api/error.hpp"

#include <fmt/format.h>

namespace servodrome::api {

std::string to_text(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

Response error_response(const ApiError& error) {
  Json body{{"what", error.what}, {"where", error.where}, {"hint", error.hint}};
  if (error.abort != dictionary::AbortCode::none) {
    body["abort"] = fmt::format("0x{:08X}", static_cast<std::uint32_t>(error.abort));
    body["abort_text"] = dictionary::text(error.abort);
  }
  return {error.status, to_text({{"error", std::move(body)}}), {}};
}

}  // namespace servodrome::api
