#include "links/ethercat/udp_socket.hpp"

#include <cerrno>
#include <fmt/format.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/socket_addresses.hpp"
#include "links/sockets.hpp"

namespace servodrome::links {
namespace {

SocketAddresses addresses_of(const Endpoint& endpoint, bool listens, const std::string& link) {
  SocketAddresses addresses = resolve(endpoint, Transport::udp, listens);
  if (addresses.unknown == nullptr) return addresses;
  throw LinkError(std::make_error_code(std::errc::address_not_available),
                  fmt::format("cannot open \"{}\": host \"{}\" is unknown ({}); write an address, such as 127.0.0.1",
                              link, endpoint.host, addresses.unknown));
}

[[noreturn]] void fail_udp(const std::string& link, const std::string& advice) {
  const std::error_code code(errno, std::generic_category());
  throw LinkError(code,
                  fmt::format("cannot open \"{}\": {}; {}", link, code.message(), advice_for(code.value(), advice)));
}

}  // namespace

FileDescriptor udp_listen(const Endpoint& endpoint, const std::string& link) {
  const auto addresses = addresses_of(endpoint, true, link);
  FileDescriptor socket = open_socket(*addresses.list);
  if (!socket.is_open() || ::bind(socket.get(), addresses.list->ai_addr, addresses.list->ai_addrlen) != 0) {
    if (errno == EADDRINUSE) {
      fail_udp(link, fmt::format("another program has UDP port {}; stop it or choose another port", endpoint.port));
    }
    if (errno == EACCES) fail_udp(link, "choose a port above 1023");
    fail_udp(link, "the host must be an address of this computer, such as 127.0.0.1");
  }
  return socket;
}

FileDescriptor udp_connect(const Endpoint& endpoint, const std::string& link) {
  const auto addresses = addresses_of(endpoint, false, link);
  FileDescriptor socket = open_socket(*addresses.list);
  if (!socket.is_open() || ::connect(socket.get(), addresses.list->ai_addr, addresses.list->ai_addrlen) != 0) {
    fail_udp(link, "check that there is a route to this address (ip route)");
  }
  return socket;
}

std::uint16_t local_port(const FileDescriptor& socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  ::getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &size);
  // The port is at the same offset in IPv4 and IPv6 addresses.
  return ntohs(reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
}

}  // namespace servodrome::links
