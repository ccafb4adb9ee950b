#pragma once

#include "links/can/client.hpp"
#include "links/can/link.hpp"

// SocketCAN, which only Linux has: elsewhere parse_can_link() refuses its names.
namespace servodrome::links {

std::unique_ptr<CanLink> open_socketcan_link(const SocketcanName& name, CanBus& bus, boost::asio::io_context& io,
                                             LineHost& host);
std::unique_ptr<CanClient> open_socketcan_client(const SocketcanName& name);

}  // namespace servodrome::links
