#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

// The schemes of link names, such as `slcan:PATH`: one table, from which parsers, messages and help texts are made.
namespace servodrome::links {

struct LinkScheme {
  std::string_view name;         // the text before the colon
  std::string_view form;         // "udp:HOST:PORT"
  std::string_view example;      // "udp:127.0.0.1:34980"
  std::string_view also;         // text after the example: what else a name may contain
  std::string_view client_form;  // the form in the help of commands that connect to the link as a client

  // For example "slcan:PATH, for example slcan:/run/servodrome/can0".
  std::string help() const;
  // True if `link` begins with the name and a colon.
  constexpr bool is_of(std::string_view link) const {
    return link.size() > name.size() && link.starts_with(name) && link[name.size()] == ':';
  }
  // The scheme, a colon and `rest`.
  std::string with(std::string_view rest) const;
};

namespace scheme {
inline constexpr LinkScheme socketcand{"socketcand", "socketcand:HOST:PORT/BUS", "socketcand:127.0.0.1:29536/can0", "",
                                       "socketcand:HOST:PORT/BUS"};
inline constexpr LinkScheme slcan{"slcan", "slcan:PATH", "slcan:/run/servodrome/can0", "", "slcan:PATH"};
inline constexpr LinkScheme socketcan{"socketcan", "socketcan:INTERFACE", "socketcan:vcan0", "", "socketcan:INTERFACE"};
inline constexpr LinkScheme raw{"raw", "raw:INTERFACE", "raw:eth1",
                                ", or raw:INTERFACE+INTERFACE for a ring; \",busy\" may follow", "raw:INTERFACE"};
inline constexpr LinkScheme udp{"udp", "udp:HOST:PORT", "udp:127.0.0.1:34980", "; \",busy\" may follow",
                                "udp:HOST[:PORT]"};
inline constexpr LinkScheme pty{"pty", "pty:PATH", "pty:/run/servodrome/axis3", "", "pty:PATH"};
inline constexpr LinkScheme serial{"serial", "serial:DEVICE", "serial:/dev/ttyUSB0", "", "serial:DEVICE"};
inline constexpr LinkScheme tcp{"tcp", "tcp:HOST:PORT", "tcp:127.0.0.1:1502", "", "tcp:HOST:PORT"};
// On every bus: a link to a master in the same process.
inline constexpr LinkScheme mem{"mem", "mem:", "", "", "mem:"};
}  // namespace scheme

using LinkSchemes = std::span<const LinkScheme>;
inline constexpr std::array can_schemes{scheme::socketcand, scheme::slcan, scheme::socketcan};
inline constexpr std::array can_schemes_hardware_first{scheme::socketcan, scheme::socketcand, scheme::slcan};
inline constexpr std::array ethercat_schemes{scheme::raw, scheme::udp};
inline constexpr std::array ethercat_schemes_easiest_first{scheme::udp, scheme::raw};  // UDP needs no privilege
inline constexpr std::array serial_schemes{scheme::pty, scheme::serial, scheme::tcp};

// True if `link` has one of the schemes.
bool is_any_of(LinkSchemes schemes, std::string_view link);

// The forms of the schemes that this system has (system_schemes.hpp) as a list, with ", " between them and `last`
// before the last one.
std::string forms(LinkSchemes schemes, std::string_view last = ", ");
std::string client_forms(LinkSchemes schemes, std::string_view last = ", ");
// The same for the names, each with its colon: "pty:, serial: or tcp:".
std::string prefixes(LinkSchemes schemes, std::string_view last = " or ");

}  // namespace servodrome::links
