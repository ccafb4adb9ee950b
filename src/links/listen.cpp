#include "links/listen.hpp"

#include <fmt/format.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/socket_options.hpp"

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
  throw LinkError(to_std(code), fmt::format("cannot listen on \"{}\": {}; {}", name, code.message(),
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
  if (!code) claim_port(acceptor, code);
  if (!code) acceptor.bind(address, code);
  if (!code) acceptor.listen(tcp::acceptor::max_listen_connections, code);
  if (code) cannot_listen(endpoint, name, code);
  return acceptor;
}

}  // namespace servodrome::links
