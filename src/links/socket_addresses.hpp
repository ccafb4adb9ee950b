#pragma once

#include <memory>
#include <netdb.h>

#include "links/file_descriptor.hpp"
#include "links/link_text.hpp"

namespace servodrome::links {

// The addresses of a host, for the system's socket functions.
struct SocketAddresses {
  std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> list{nullptr, &::freeaddrinfo};
  const char* unknown = nullptr;  // why the host is unknown; nullptr: it has at least one address
};

// `type`: SOCK_STREAM or SOCK_DGRAM; `flags`: AI_ flags of getaddrinfo.
SocketAddresses resolve(const Endpoint& endpoint, int type, int flags = 0);

// Connects to the first of the addresses that accepts a TCP connection before the deadline. The socket does not block
// and has no Nagle delay. If no address accepts, the socket is not open, and `reason` is the last error number.
FileDescriptor connect_tcp(const SocketAddresses& addresses, Deadline deadline, int& reason);

}  // namespace servodrome::links
