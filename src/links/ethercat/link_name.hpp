#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "links/link_text.hpp"

namespace servodrome::links {

inline constexpr std::uint16_t ethercat_udp_port = 34980;  // 88A4h (ETG.1000.4 clause 5.3.2)

// Ethernet frames on an interface of this computer.
struct RawName {
  std::string interface;                                // at most 15 characters
  std::optional<std::string> secondary = std::nullopt;  // where the master's second port is, for a ring
  bool busy = false;
};
// The content of the frames in UDP packets.
struct EthercatUdpName {
  std::string host;
  std::uint16_t port = ethercat_udp_port;
  bool busy = false;
};

using EthercatLinkName = std::variant<RawName, EthercatUdpName, MemName>;

// Reads `raw:INTERFACE`, `raw:INTERFACE+INTERFACE` (a ring with two ports of the master), `udp:HOST:PORT` (PORT may be
// left out; an IPv6 address stands in brackets) or `mem:`. A `,busy` at the end lets the link look for frames without
// end instead of sleeping until one comes: a processor for the latency. Throws LinkError (std::errc::invalid_argument)
// that says what is wrong where and what is expected.
EthercatLinkName parse_ethercat_link(std::string_view text);

// The name as parse_ethercat_link() reads it.
std::string to_string(const EthercatLinkName& name);

}  // namespace servodrome::links
