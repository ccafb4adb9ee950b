#pragma once

#include <string>
#include <string_view>
#include <variant>

#include "links/link_text.hpp"

namespace servodrome::links {

// A pseudo terminal that programs find at `path`.
struct PtyName {
  std::string path;
};
// A serial port of this computer.
struct TtyName {
  std::string device;
};
// Modbus TCP. Port 502 is the standard's; 1502 needs no privilege.
struct ModbusTcpName {
  Endpoint endpoint;
};

using SerialLinkName = std::variant<PtyName, TtyName, ModbusTcpName, MemName>;

inline constexpr std::uint16_t default_modbus_tcp_port = 1502;

// Reads `pty:PATH`, `serial:DEVICE`, `tcp:HOST:PORT` (PORT may be left out: 1502; an IPv6 address stands in brackets)
// or `mem:`. Throws LinkError (std::errc::invalid_argument) that says what is wrong where and what is expected.
SerialLinkName parse_serial_link(std::string_view text);

// The name as parse_serial_link() reads it.
std::string to_string(const SerialLinkName& name);

}  // namespace servodrome::links
