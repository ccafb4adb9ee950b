#pragma once

#include <memory>

#include "links/file_descriptor.hpp"
#include "links/link_text.hpp"

struct addrinfo;

namespace servodrome::links {

// The addresses of a host, for the system's socket functions.
struct SocketAddresses {
  struct Free {
    void operator()(addrinfo* list) const;
  };
  std::unique_ptr<addrinfo, Free> list;
  const char* unknown = nullptr;  // why the host is unknown; nullptr: it has at least one address
};

enum class Transport : std::uint8_t { tcp, udp };

// `listens`: the addresses are for a socket that listens, so an empty host is every address of this computer.
SocketAddresses resolve(const Endpoint& endpoint, Transport transport, bool listens = false);

// Connects to the first of the addresses that accepts a TCP connection before the deadline. The socket does not block
// and has no Nagle delay. If no address accepts, the socket is not open, and `reason` is the last error number.
FileDescriptor connect_tcp(const SocketAddresses& addresses, Deadline deadline, int& reason);

}  // namespace servodrome::links
