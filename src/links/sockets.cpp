#include "links/sockets.hpp"

#include <cerrno>

#include "links/socket_options.hpp"

namespace servodrome::links {

void begin_sockets() {}

FileDescriptor open_socket(const addrinfo& address) {
  return FileDescriptor(
      ::socket(address.ai_family, address.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, address.ai_protocol));
}

int begin_connection(Descriptor socket, const addrinfo& address) {
  return ::connect(socket, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
}

int connection_error(Descriptor socket) {
  int reason = 0;
  socklen_t size = sizeof reason;
  ::getsockopt(socket, SOL_SOCKET, SO_ERROR, &reason, &size);
  return reason;
}

void set_option(Descriptor socket, int level, int name, int value) {
  ::setsockopt(socket, level, name, &value, sizeof value);
}

void limit_unacknowledged(Descriptor socket, int seconds) {
  set_option(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, 1000 * seconds);
}

// A line that starts again soon finds its port free, although connections of the last one are still in TIME_WAIT.
void claim_port(boost::asio::ip::tcp::acceptor& acceptor, boost::system::error_code& code) {
  acceptor.set_option(boost::asio::ip::tcp::acceptor::reuse_address(true), code);
}

void acknowledge_at_once(boost::asio::ip::tcp::socket& socket) {
  set_option(socket.native_handle(), IPPROTO_TCP, TCP_QUICKACK, 1);
}

}  // namespace servodrome::links
