#pragma once

#include <string>

#include "links/file_descriptor.hpp"
#include "links/link_text.hpp"

namespace servodrome::links {

// Nonblocking UDP sockets. Both functions throw LinkError; `link` is the name in messages.
//
// Opens a socket that receives the datagrams sent to `endpoint`, an address of this computer.
FileDescriptor udp_listen(const Endpoint& endpoint, const std::string& link);
// Opens a socket that sends to an address and receives only from there.
FileDescriptor udp_connect(const Endpoint& endpoint, const std::string& link);
// The port that the socket is bound to.
std::uint16_t local_port(const FileDescriptor& socket);

}  // namespace servodrome::links
