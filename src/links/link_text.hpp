#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "links/link_scheme.hpp"

// The common part of reading link names of all buses.
namespace servodrome::links {

// The name of a link to a master in the same process.
struct MemName {};

// The text of a link name while it is read, and how to report errors about it.
struct LinkText {
  const char* bus;        // "CAN"
  std::string_view text;  // as written

  std::string_view scheme() const { return text.substr(0, text.find(':')); }
  // The text behind the first colon; nothing if there is no colon.
  std::optional<std::string_view> rest() const;

  // Throws LinkError if this system has no links of the scheme.
  void refuse_absent() const;
  // Throw LinkError (std::errc::invalid_argument) with the error and the form to write.
  [[noreturn]] void refuse(std::string_view what, const LinkScheme& scheme) const;
  [[noreturn]] void refuse_scheme(LinkSchemes schemes) const;
};

// Read the text behind the colon of a `mem:` link, or a path. Throw like `link.refuse`.
MemName parse_mem(const LinkText& link, std::string_view rest);
std::string parse_path(const LinkText& link, std::string_view rest, const LinkScheme& scheme);

struct Endpoint {
  std::string host;
  std::uint16_t port = 0;
};

// Reads `HOST`, `HOST:PORT` or `[ADDRESS]:PORT`. Throws like `link.refuse`.
Endpoint parse_endpoint(const LinkText& link, std::string_view text, std::uint16_t default_port,
                        const LinkScheme& scheme);
// Returns the text that parse_endpoint() reads.
std::string to_string(const Endpoint& endpoint);

// Throw LinkError for a `mem:` link of `bus` ("CAN") that outside programs are to reach, or that a client is to open
// from another process. `schemes` are the alternatives.
[[noreturn]] void refuse_mem_link(const char* bus, LinkSchemes schemes);
[[noreturn]] void refuse_mem_client(const char* bus, LinkSchemes schemes);

// Returns true if the word is not empty and has no spaces, control characters, angle brackets or slashes.
bool is_plain_word(std::string_view word);

inline constexpr std::size_t longest_interface_name = 15;  // of Linux: IFNAMSIZ less the terminating zero

}  // namespace servodrome::links
