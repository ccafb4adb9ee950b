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
  std::optional<std::string> secondary = std::nullopt;  // interface at the master's second port, for a ring
  bool busy = false;
};
// The contents of frames in UDP packets.
struct EthercatUdpName {
  std::string host;
  std::uint16_t port = ethercat_udp_port;
  bool busy = false;
};

using EthercatLinkName = std::variant<RawName, EthercatUdpName, MemName>;

// Reads `raw:INTERFACE`, `raw:INTERFACE+INTERFACE` (a ring with two ports of the master), `udp:HOST:PORT` (PORT may be
// left out; an IPv6 address stands in brackets) or `mem:`. With `,busy` at the end of raw: or udp: the link polls
// continuously instead of sleeping until a frame comes: low latency at the cost of a processor. Throws LinkError
// (std::errc::invalid_argument) that describes the error, its place and the expected form.
EthercatLinkName parse_ethercat_link(std::string_view text);

// Returns the name in the form that parse_ethercat_link() reads.
std::string to_string(const EthercatLinkName& name);

}  // namespace servodrome::links
