#include "links/socket_options.hpp"

#include <array>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace servodrome::links {

using boost::asio::ip::tcp;

// A line that starts again soon finds its port free, although connections of the last one are still in TIME_WAIT.
void claim_port(tcp::acceptor& acceptor, boost::system::error_code& code) {
  acceptor.set_option(tcp::acceptor::reuse_address(true), code);
}

void serve_promptly(tcp::socket& socket) {
  struct Option {
    int level;
    int name;
    int value;
  };
  constexpr std::array options{
      Option{IPPROTO_TCP, TCP_NODELAY, 1},           Option{SOL_SOCKET, SO_KEEPALIVE, 1},
      Option{IPPROTO_TCP, TCP_KEEPIDLE, 30},  // seconds
      Option{IPPROTO_TCP, TCP_KEEPINTVL, 10},        Option{IPPROTO_TCP, TCP_KEEPCNT, 3},
      Option{IPPROTO_TCP, TCP_USER_TIMEOUT, 60'000},  // ms until unacknowledged data end the connection
  };
  for (const Option& option : options) {
    ::setsockopt(socket.native_handle(), option.level, option.name, &option.value, sizeof option.value);
  }
  acknowledge_at_once(socket);
}

void acknowledge_at_once(tcp::socket& socket) {
  const int on = 1;
  ::setsockopt(socket.native_handle(), IPPROTO_TCP, TCP_QUICKACK, &on, sizeof on);
}

}  // namespace servodrome::links
