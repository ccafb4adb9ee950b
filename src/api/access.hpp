#pragma once

#include <optional>
#include <string>

#include "api/http.hpp"

// Access control of the bench API. It protects against three dangers: a web page in the user's browser that sends
// requests to loopback (it cannot hide its Origin), a web page whose host name points to loopback (DNS rebinding: the
// Host is that name), and other machines.
namespace servodrome::api {

struct Access {
  std::string token;  // never empty
};

// Returns the value of SERVODROME_TOKEN, or 128 random bits in hexadecimal if it is not set.
std::string make_token();

// Returns the refusal (401 or 403), or nothing if the request is allowed:
// - with the right token (Authorization: Bearer TOKEN) everything is allowed, with a wrong one nothing;
// - without a token, a Host that is neither an IP address nor localhost is refused;
// - other clients may read; to write, a client must be on loopback, without Origin or with the studio's own, which is
//   http://HOST of the request itself.
std::optional<Response> refuse(const Access& access, const Request& request);

}  // namespace servodrome::api
