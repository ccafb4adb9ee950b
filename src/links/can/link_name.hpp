#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "links/link_text.hpp"

namespace servodrome::links {

struct SocketcandName {
  std::string host;
  std::uint16_t port = 29536;
  std::string bus;  // at most 16 characters (socketcand protocol, mode NO_BUS)
};
struct SlcanName {
  std::string path;
};
struct SocketcanName {
  std::string interface;  // at most 15 characters
};

using CanLinkName = std::variant<SocketcandName, SlcanName, SocketcanName, MemName>;

// Reads `socketcand:HOST:PORT/BUS` (PORT and BUS may be left out: 29536, can0; an IPv6 address stands in brackets),
// `slcan:PATH`, `socketcan:INTERFACE` or `mem:`. Throws LinkError (std::errc::invalid_argument) that describes the
// error, its place and the expected form.
CanLinkName parse_can_link(std::string_view text);

// Returns the name in the form that parse_can_link() reads.
std::string to_string(const CanLinkName& name);

}  // namespace servodrome::links
