#include "links/socket_options.hpp"

#include <array>

#include "links/sockets.hpp"

namespace servodrome::links {

void serve_promptly(boost::asio::ip::tcp::socket& socket) {
  struct Option {
    int level;
    int name;
    int value;
  };
  constexpr std::array options{
      Option{IPPROTO_TCP, TCP_NODELAY, 1},    Option{SOL_SOCKET, SO_KEEPALIVE, 1},
      Option{IPPROTO_TCP, TCP_KEEPIDLE, 30},  // seconds
      Option{IPPROTO_TCP, TCP_KEEPINTVL, 10}, Option{IPPROTO_TCP, TCP_KEEPCNT, 3},
  };
  for (const auto& [level, name, value] : options) set_option(socket.native_handle(), level, name, value);
  limit_unacknowledged(socket.native_handle(), 60);
  acknowledge_at_once(socket);
}

}  // namespace servodrome::links
