#include "links/socket_addresses.hpp"

#include <cerrno>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <string>
#include <sys/socket.h>

namespace servodrome::links {
namespace {

// Returns 0, or the error that prevented the connection.
int connect_one(const addrinfo& address, FileDescriptor& socket, Deadline deadline) {
  socket.reset(::socket(address.ai_family, address.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, address.ai_protocol));
  if (!socket.is_open()) return errno;
  if (::connect(socket.get(), address.ai_addr, address.ai_addrlen) == 0) return 0;
  if (errno != EINPROGRESS) return errno;
  if (!wait_writable(socket.get(), deadline)) return ETIMEDOUT;
  int reason = 0;
  socklen_t size = sizeof reason;
  ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &reason, &size);
  return reason;
}

}  // namespace

void SocketAddresses::Free::operator()(addrinfo* list) const { ::freeaddrinfo(list); }

SocketAddresses resolve(const Endpoint& endpoint, Transport transport, bool listens) {
  addrinfo hints{};
  hints.ai_socktype = transport == Transport::tcp ? SOCK_STREAM : SOCK_DGRAM;
  hints.ai_flags = AI_NUMERICSERV | (listens ? AI_PASSIVE : 0);
  addrinfo* found = nullptr;
  SocketAddresses addresses;
  const int failure = ::getaddrinfo(endpoint.host.c_str(), std::to_string(endpoint.port).c_str(), &hints, &found);
  if (failure != 0) {
    addresses.unknown = ::gai_strerror(failure);
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
    const int on = 1;
    ::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return socket;
  }
  return {};
}

}  // namespace servodrome::links
