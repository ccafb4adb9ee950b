#pragma once

#include <boost/asio/ip/tcp.hpp>

namespace servodrome::links {

// Sets the option with which bind() fails if, and only if, another program listens at the port.
void claim_port(boost::asio::ip::tcp::acceptor& acceptor, boost::system::error_code& code);
// Sets up a client's socket: data are sent immediately (no Nagle delay), received data are acknowledged immediately,
// and keepalive ends the connection about a minute after the peer has vanished.
void serve_promptly(boost::asio::ip::tcp::socket& socket);
// Must be called again after each receive and send, which switch the immediate acknowledge off. A client that uses
// Nagle's algorithm sends its next small frame only after the acknowledge, which would otherwise come 40 ms later.
void acknowledge_at_once(boost::asio::ip::tcp::socket& socket);

}  // namespace servodrome::links
