#include "links/socket_options.hpp"

#include <array>
#include <mstcpip.h>
#include <mswsock.h>
#include <ws2tcpip.h>

namespace servodrome::links {

using boost::asio::ip::tcp;

// With SO_REUSEADDR, Windows would let two programs listen at the same port.
void claim_port(tcp::acceptor& acceptor, boost::system::error_code& code) {
  const BOOL on = TRUE;
  const int failed = ::setsockopt(acceptor.native_handle(), SOL_SOCKET, SO_EXCLUSIVEADDRUSE,
                                  reinterpret_cast<const char*>(&on), sizeof on);
  if (failed != 0) code.assign(::WSAGetLastError(), boost::system::system_category());
}

void serve_promptly(tcp::socket& socket) {
  struct Option {
    int level;
    int name;
    DWORD value;
  };
  constexpr std::array options{
      Option{IPPROTO_TCP, TCP_NODELAY, 1},    Option{SOL_SOCKET, SO_KEEPALIVE, 1},
      Option{IPPROTO_TCP, TCP_KEEPIDLE, 30},  // seconds
      Option{IPPROTO_TCP, TCP_KEEPINTVL, 10}, Option{IPPROTO_TCP, TCP_KEEPCNT, 3},
      Option{IPPROTO_TCP, TCP_MAXRT, 60},  // seconds until unacknowledged data end the connection
  };
  for (const Option& option : options) {
    ::setsockopt(socket.native_handle(), option.level, option.name, reinterpret_cast<const char*>(&option.value),
                 sizeof option.value);
  }
  int segments = 1;  // an acknowledge for each segment
  DWORD unused = 0;
  ::WSAIoctl(socket.native_handle(), SIO_TCP_SET_ACK_FREQUENCY, &segments, sizeof segments, nullptr, 0, &unused,
             nullptr, nullptr);
}

// serve_promptly() has set it for the whole connection.
void acknowledge_at_once(tcp::socket& /*socket*/) {}

}  // namespace servodrome::links
