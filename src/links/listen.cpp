#include "links/listen.hpp"

#include <array>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

using boost::asio::ip::tcp;
using boost::system::error_code;

std::error_code to_std(const error_code& code) { return {code.value(), std::system_category()}; }

[[noreturn]] void cannot_listen(const Endpoint& endpoint, const std::string& name, const error_code& code) {
  std::string advice = "check the host";
  if (code == boost::asio::error::address_in_use) {
    advice = fmt::format("another program has port {}; stop it or choose another port", endpoint.port);
  } else if (code == boost::asio::error::access_denied) {
    advice = "choose a port above 1023";
  } else if (code == boost::system::errc::address_not_available) {
    advice = "the host must be an address of this computer, such as 127.0.0.1";
  }
  throw LinkError(to_std(code), fmt::format("cannot listen on \"{}\": {}; {}", name, to_std(code).message(),
                                            advice_for(code.value(), advice)));
}

}  // namespace

tcp::acceptor listen_at(boost::asio::io_context& io, const Endpoint& endpoint, const std::string& name) {
  error_code code;
  tcp::resolver resolver(io);
  const auto found = resolver.resolve(endpoint.host, std::to_string(endpoint.port), tcp::resolver::passive, code);
  if (code || found.empty()) {
    throw LinkError(to_std(code), fmt::format("cannot listen on \"{}\": host \"{}\" is unknown ({}); write an address "
                                              "of this computer, such as 127.0.0.1",
                                              name, endpoint.host, code.message()));
  }
  const tcp::endpoint address = found.begin()->endpoint();
  tcp::acceptor acceptor(io);
  acceptor.open(address.protocol(), code);
  if (!code) acceptor.set_option(tcp::acceptor::reuse_address(true), code);
  if (!code) acceptor.bind(address, code);
  if (!code) acceptor.listen(tcp::acceptor::max_listen_connections, code);
  if (code) cannot_listen(endpoint, name, code);
  return acceptor;
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
