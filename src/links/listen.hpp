#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <string>

#include "links/link_text.hpp"

namespace servodrome::links {

// Opens a socket that listens at `endpoint`; with port 0 the system chooses the port. Throws LinkError for the link
// `name`.
boost::asio::ip::tcp::acceptor listen_at(boost::asio::io_context& io, const Endpoint& endpoint,
                                         const std::string& name);

// Sets a client's socket so that data are sent immediately (no Nagle delay), received data are acknowledged
// immediately, and keepalive ends the connection about a minute after the peer has vanished.
void serve_promptly(boost::asio::ip::tcp::socket& socket);
// Must be called again after each receive and send, which switch the immediate acknowledge off. A client that uses
// Nagle's algorithm sends its next small frame only after the acknowledge, which would otherwise come 40 ms later.
void acknowledge_at_once(boost::asio::ip::tcp::socket& socket);

}  // namespace servodrome::links
