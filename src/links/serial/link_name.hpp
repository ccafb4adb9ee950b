#pragma once

#include <string>
#include <string_view>
#include <variant>

#include "links/link_text.hpp"

namespace servodrome::links {

// A pseudo terminal that programs open at `path`.
struct PtyName {
  std::string path;
};
// A serial port of this computer.
struct TtyName {
  std::string device;
};
// Modbus TCP. The standard port is 502; 1502 needs no privilege.
struct ModbusTcpName {
  Endpoint endpoint;
};

using SerialLinkName = std::variant<PtyName, TtyName, ModbusTcpName, MemName>;

inline constexpr std::uint16_t default_modbus_tcp_port = 1502;

// Reads `pty:PATH`, `serial:DEVICE`, `tcp:HOST:PORT` (PORT may be left out: 1502; an IPv6 address stands in brackets)
// or `mem:`. Throws LinkError (std::errc::invalid_argument) that describes the error, its place and the expected form.
SerialLinkName parse_serial_link(std::string_view text);

// Returns the name in the form that parse_serial_link() reads.
std::string to_string(const SerialLinkName& name);

}  // namespace servodrome::links
