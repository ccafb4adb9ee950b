#include "links/socket_addresses.hpp"

#include <cerrno>
#include <string>

#include "links/sockets.hpp"

namespace servodrome::links {
namespace {

// Returns 0, or the error that prevented the connection.
int connect_one(const addrinfo& address, FileDescriptor& socket, Deadline deadline) {
  socket = open_socket(address);
  if (!socket.is_open()) return errno;
  const int begun = begin_connection(socket.get(), address);
  if (begun != EINPROGRESS) return begun;
  return wait_writable(socket.get(), deadline) ? connection_error(socket.get()) : ETIMEDOUT;
}

}  // namespace

void SocketAddresses::Free::operator()(addrinfo* addresses) const { ::freeaddrinfo(addresses); }

SocketAddresses resolve(const Endpoint& endpoint, Transport transport, bool listens) {
  begin_sockets();
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
    set_option(socket.get(), IPPROTO_TCP, TCP_NODELAY, 1);
    return socket;
  }
  return {};
}

}  // namespace servodrome::links
