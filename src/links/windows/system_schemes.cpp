#include "links/system_schemes.hpp"

namespace servodrome::links {

std::string_view absence_of(std::string_view scheme_name) {
  if (scheme_name == scheme::socketcan.name) {
    return "SocketCAN is not available on Windows; use socketcand:127.0.0.1:29536/can0, or slcan:COM5";
  }
  if (scheme_name == scheme::raw.name) {
    return "raw Ethernet is not available on Windows; use udp:127.0.0.1:34980";
  }
  if (scheme_name == scheme::pty.name) {
    return "pseudo terminals are not available on Windows; use serial:COM5 with a pair of connected ports, or "
           "tcp:127.0.0.1:1502";
  }
  return {};
}

std::string_view example_here(const LinkScheme& scheme) {
  if (scheme.name == scheme::slcan.name) return "slcan:COM5";
  if (scheme.name == scheme::serial.name) return "serial:COM3";
  return scheme.example;
}

}  // namespace servodrome::links
