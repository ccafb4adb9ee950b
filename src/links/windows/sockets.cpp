#include "links/sockets.hpp"

#include <cerrno>

#include "links/socket_options.hpp"
#include "links/windows/socket_error.hpp"

namespace servodrome::links {
namespace {

int last_error() { return error_number(static_cast<unsigned long>(::WSAGetLastError())); }

}  // namespace

// A second call of WSAStartup, as Asio makes it, has no effect.
void begin_sockets() {
  static const int failure = [] {
    WSADATA unused{};
    return ::WSAStartup(MAKEWORD(2, 2), &unused);
  }();
  static_cast<void>(failure);
}

FileDescriptor open_socket(const addrinfo& address) {
  FileDescriptor socket(::socket(address.ai_family, address.ai_socktype, address.ai_protocol));
  unsigned long on = 1;
  if (socket.is_open() && ::ioctlsocket(socket.get(), static_cast<long>(FIONBIO), &on) == 0) return socket;
  errno = last_error();
  return {};
}

int begin_connection(Descriptor socket, const addrinfo& address) {
  if (::connect(socket, address.ai_addr, static_cast<int>(address.ai_addrlen)) == 0) return 0;
  return ::WSAGetLastError() == WSAEWOULDBLOCK ? EINPROGRESS : last_error();
}

int connection_error(Descriptor socket) {
  int reason = 0;
  int size = sizeof reason;
  ::getsockopt(socket, SOL_SOCKET, SO_ERROR, reinterpret_cast<char*>(&reason), &size);
  return reason == 0 ? 0 : error_number(static_cast<unsigned long>(reason));
}

void set_option(Descriptor socket, int level, int name, int value) {
  ::setsockopt(socket, level, name, reinterpret_cast<const char*>(&value), sizeof value);
}

void limit_unacknowledged(Descriptor socket, int seconds) { set_option(socket, IPPROTO_TCP, TCP_MAXRT, seconds); }

// With SO_REUSEADDR, Windows would let two programs listen at the same port.
void claim_port(boost::asio::ip::tcp::acceptor& acceptor, boost::system::error_code& code) {
  const BOOL on = TRUE;
  const int failed = ::setsockopt(acceptor.native_handle(), SOL_SOCKET, SO_EXCLUSIVEADDRUSE,
                                  reinterpret_cast<const char*>(&on), sizeof on);
  if (failed != 0) code.assign(::WSAGetLastError(), boost::system::system_category());
}

// Acknowledges each segment; the setting holds for the whole connection.
void acknowledge_at_once(boost::asio::ip::tcp::socket& socket) {
  int segments = 1;
  DWORD unused = 0;
  ::WSAIoctl(socket.native_handle(), SIO_TCP_SET_ACK_FREQUENCY, &segments, sizeof segments, nullptr, 0, &unused,
             nullptr, nullptr);
}

}  // namespace servodrome::links
