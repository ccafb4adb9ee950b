#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

// Reading the names of links: what those of all buses have in common.
namespace servodrome::links {

// A link to a master in the same process.
struct MemName {};

// The name of a link while it is read: what bus it is of, and how to complain about it.
struct LinkText {
  const char* bus;        // "CAN"
  std::string_view text;  // as written

  std::string_view scheme() const { return text.substr(0, text.find(':')); }
  // Behind the first colon; nothing if there is none.
  std::optional<std::string_view> rest() const;

  // Throws LinkError (std::errc::invalid_argument): what is wrong, and the form to write.
  [[noreturn]] void refuse(std::string_view what, std::string_view form) const;
  [[noreturn]] void refuse_scheme(std::string_view forms) const;
};

struct Endpoint {
  std::string host;
  std::uint16_t port = 0;
};

// `HOST`, `HOST:PORT` or `[ADDRESS]:PORT`; throws as `link.refuse`.
Endpoint parse_endpoint(const LinkText& link, std::string_view text, std::uint16_t default_port, std::string_view form);
// As parse_endpoint() reads it.
std::string to_string(const Endpoint& endpoint);

// No spaces, control characters, angle brackets or slashes, and not empty.
bool is_plain_word(std::string_view word);

}  // namespace servodrome::links
