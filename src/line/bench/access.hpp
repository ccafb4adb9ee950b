#pragma once

#include <optional>
#include <string>

#include "line/bench/http.hpp"

// Who may use the bench API. Three dangers: a web page in the user's browser that sends requests to loopback (it cannot
// hide its Origin), one that points its own host name at loopback (DNS rebinding: the Host is that name), and another
// machine.
namespace servodrome::line::bench {

struct Access {
  std::string token;  // never empty
};

// From SERVODROME_TOKEN, else 128 random bits in hexadecimal.
std::string make_token();

// The refusal (401 or 403), or nothing if the request may pass:
// - with the right token (Authorization: Bearer TOKEN) everything may;
// - a Host that is neither an IP address nor localhost is refused;
// - any other client may read; to write takes a loopback peer without Origin or with the studio's own, which is
//   http://HOST of the request itself.
std::optional<Response> refuse(const Access& access, const Request& request);

}  // namespace servodrome::line::bench
