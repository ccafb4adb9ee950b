#include "links/socket_addresses.hpp"

#include <cerrno>
#include <string>
#include <ws2tcpip.h>

#include "links/windows/socket_error.hpp"

namespace servodrome::links {
namespace {

// Must be called before the first socket is used. A second call, as Asio makes it, has no effect.
void start_winsock() {
  static const int failure = [] {
    WSADATA unused{};
    return ::WSAStartup(MAKEWORD(2, 2), &unused);
  }();
  static_cast<void>(failure);
}

int last_socket_error() { return error_number(static_cast<unsigned long>(::WSAGetLastError())); }

// Returns 0, or the error that prevented the connection.
int connect_one(const addrinfo& address, FileDescriptor& socket, Deadline deadline) {
  socket.reset(::socket(address.ai_family, address.ai_socktype, address.ai_protocol));
  unsigned long on = 1;
  if (!socket.is_open() || ::ioctlsocket(socket.get(), static_cast<long>(FIONBIO), &on) != 0)
    return last_socket_error();
  if (::connect(socket.get(), address.ai_addr, static_cast<int>(address.ai_addrlen)) == 0) return 0;
  if (::WSAGetLastError() != WSAEWOULDBLOCK) return last_socket_error();
  if (!wait_writable(socket.get(), deadline)) return ETIMEDOUT;
  int reason = 0;
  int size = sizeof reason;
  ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, reinterpret_cast<char*>(&reason), &size);
  return reason == 0 ? 0 : error_number(static_cast<unsigned long>(reason));
}

}  // namespace

void SocketAddresses::Free::operator()(addrinfo* list) const { ::freeaddrinfo(list); }

SocketAddresses resolve(const Endpoint& endpoint, Transport transport, bool listens) {
  start_winsock();
  addrinfo hints{};
  hints.ai_socktype = transport == Transport::tcp ? SOCK_STREAM : SOCK_DGRAM;
  hints.ai_flags = listens ? AI_PASSIVE : 0;
  addrinfo* found = nullptr;
  SocketAddresses addresses;
  const int failure = ::getaddrinfo(endpoint.host.c_str(), std::to_string(endpoint.port).c_str(), &hints, &found);
  if (failure != 0) {
    addresses.unknown = ::gai_strerrorA(failure);
  } else {
    addresses.list.reset(found);
  }
  return addresses;
}

FileDescriptor connect_tcp(const SocketAddresses& addresses, Deadline deadline, int& reason) {
  reason = ECONNREFUSED;
  for (const addrinfo* address = addresses.list.get(); address != nullptr; address = address->ai_next) {
    FileDescriptor socket;
    reason = connect_one(*address, socket, deadline);
    if (reason != 0) continue;
    const DWORD on = 1;
    ::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, reinterpret_cast<const char*>(&on), sizeof on);
    return socket;
  }
  return {};
}

}  // namespace servodrome::links
