#pragma once

#include <functional>
#include <span>

#include "links/ethercat/client.hpp"
#include "links/ethercat/link.hpp"

// The links whose sockets differ between systems. Raw Ethernet is for Linux only: elsewhere parse_ethercat_link()
// refuses its names.
namespace servodrome::links {

std::unique_ptr<EthercatLink> open_udp_link(const EthercatUdpName& name, EthercatBus& bus, boost::asio::io_context& io,
                                            LineHost& host);
std::unique_ptr<EthercatLink> open_raw_link(const RawName& name, EthercatBus& bus, boost::asio::io_context& io,
                                            DescriptorWatch& watch, LineHost& host);
std::unique_ptr<EthercatClient> open_raw_client(const RawName& name);

// Calls `take` for each frame on the interface until `over` returns true; sends nothing. Returns 0, or the error number
// (errno) with which the interface was lost. Throws LinkError if the interface cannot be opened.
int monitor_interface(const RawName& name, const std::function<bool()>& over,
                      const std::function<void(std::span<const std::uint8_t> frame)>& take);

}  // namespace servodrome::links
