// The client's end only: the link's socket is Asio's (udp_link.cpp).
#include "links/ethercat/udp_socket.hpp"

#include <cerrno>
#include <fmt/format.h>
#include <mswsock.h>
#include <ws2tcpip.h>

#include "links/link_error.hpp"
#include "links/socket_addresses.hpp"
#include "links/windows/socket_error.hpp"

namespace servodrome::links {

FileDescriptor udp_connect(const Endpoint& endpoint, const std::string& link) {
  const auto addresses = resolve(endpoint, Transport::udp);
  if (addresses.unknown != nullptr) {
    throw LinkError(std::make_error_code(std::errc::address_not_available),
                    fmt::format("cannot open \"{}\": host \"{}\" is unknown ({}); write an address, such as 127.0.0.1",
                                link, endpoint.host, addresses.unknown));
  }
  const addrinfo& address = *addresses.list;
  FileDescriptor socket(::socket(address.ai_family, SOCK_DGRAM, 0));
  unsigned long on = 1;
  if (!socket.is_open() || ::ioctlsocket(socket.get(), static_cast<long>(FIONBIO), &on) != 0 ||
      ::connect(socket.get(), address.ai_addr, static_cast<int>(address.ai_addrlen)) != 0) {
    const std::error_code code(error_number(static_cast<unsigned long>(::WSAGetLastError())), std::generic_category());
    throw LinkError(
        code, fmt::format("cannot open \"{}\": {}; check that there is a route to this address (route print)", link,
                          code.message()));
  }
  return socket;
}

}  // namespace servodrome::links
