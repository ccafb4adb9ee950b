#include "api/access.hpp"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cctype>
#include <cstdlib>
#include <fmt/format.h>
#include <random>
#include <string_view>

#include "api/error.hpp"

namespace servodrome::api {
namespace {

bool is_port(std::string_view text) {  // the text includes the colon; empty is valid too
  return text.empty() || (text.starts_with(':') && text.find_first_not_of("0123456789", 1) == std::string_view::npos);
}

// Returns the host of "HOST", "HOST:PORT", "[IPV6]" or "[IPV6]:PORT"; empty if `host` has another form.
std::string_view without_port(std::string_view host) {
  const bool in_brackets = host.starts_with('[');
  const std::size_t end = std::min(host.find(in_brackets ? ']' : ':'), host.size());
  const std::string_view name = host.substr(in_brackets ? 1 : 0, end - (in_brackets ? 1 : 0));
  if (in_brackets && (end == host.size() || name.find(':') == std::string_view::npos)) return {};
  return is_port(host.substr(end + (in_brackets ? 1 : 0))) ? name : std::string_view{};
}

bool equal_ignoring_case(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (std::tolower(static_cast<unsigned char>(a[i])) != std::tolower(static_cast<unsigned char>(b[i]))) return false;
  }
  return true;
}

bool cannot_be_rebound(std::string_view host) {
  const std::string_view name = without_port(host);
  if (equal_ignoring_case(name, "localhost")) return true;
  boost::system::error_code error;
  boost::asio::ip::make_address(std::string(name), error);
  return !error;
}

// Compares in constant time, wherever the first difference is.
bool equal_secrets(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference |= static_cast<unsigned>(static_cast<unsigned char>(a[i])) ^ static_cast<unsigned char>(b[i]);
  }
  return difference == 0;
}

}  // namespace

std::string make_token() {
  if (const char* given = std::getenv("SERVODROME_TOKEN"); given != nullptr && *given != '\0') return given;
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", random());
  return token;
}

std::optional<Response> refuse(const Access& access, const Request& request) {
  constexpr std::string_view scheme = "Bearer ";
  if (!request.authorization.empty()) {
    const std::string_view given = request.authorization;
    if (given.size() > scheme.size() && equal_ignoring_case(given.substr(0, scheme.size()), scheme) &&
        equal_secrets(given.substr(scheme.size()), access.token)) {
      return std::nullopt;
    }
    return error_response({401, "the token is wrong", "Authorization",
                           "send Authorization: Bearer TOKEN with the token that `servodrome up` printed"});
  }
  if (!cannot_be_rebound(request.host)) {
    return error_response({403, fmt::format("the host name \"{}\" is not allowed without a token", request.host),
                           "Host", "use an IP address or localhost, or send Authorization: Bearer TOKEN"});
  }
  if (request.method == Method::get) return std::nullopt;
  if (!request.from_loopback) {
    return error_response({401, "writing from another machine needs the token", "Authorization",
                           "send Authorization: Bearer TOKEN with the token that `servodrome up` printed"});
  }
  if (request.has_origin && !equal_ignoring_case(request.origin, "http://" + request.host)) {
    return error_response({403, fmt::format("a web page of \"{}\" may not write here", request.origin), "Origin",
                           "send Authorization: Bearer TOKEN with the token that `servodrome up` printed"});
  }
  return std::nullopt;
}

}  // namespace servodrome::api
