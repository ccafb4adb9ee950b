// The client's end only: the link's socket is Asio's (udp_link.cpp).
#include "links/ethercat/udp_socket.hpp"

#include <cerrno>
#include <fmt/format.h>

#include "links/link_error.hpp"
#include "links/socket_addresses.hpp"
#include "links/sockets.hpp"

namespace servodrome::links {

FileDescriptor udp_connect(const Endpoint& endpoint, const std::string& link) {
  const auto addresses = resolve(endpoint, Transport::udp);
  if (addresses.unknown != nullptr) {
    throw LinkError(std::make_error_code(std::errc::address_not_available),
                    fmt::format("cannot open \"{}\": host \"{}\" is unknown ({}); write an address, such as 127.0.0.1",
                                link, endpoint.host, addresses.unknown));
  }
  const addrinfo& address = *addresses.list;
  FileDescriptor socket = open_socket(address);
  const int reason = socket.is_open() ? begin_connection(socket.get(), address) : errno;
  if (reason != 0) {
    const std::error_code code(reason, std::generic_category());
    throw LinkError(
        code, fmt::format("cannot open \"{}\": {}; check that there is a route to this address (route print)", link,
                          code.message()));
  }
  return socket;
}

}  // namespace servodrome::links
