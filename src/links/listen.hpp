#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <string>

#include "links/link_text.hpp"

namespace servodrome::links {

// A socket that listens at `endpoint`; port 0: one the system chooses. Throws LinkError about the link `name`.
boost::asio::ip::tcp::acceptor listen_at(boost::asio::io_context& io, const Endpoint& endpoint,
                                         const std::string& name);

// For the socket of a client: what is sent to it leaves at once, what it sends is acknowledged at once, and a peer that
// is gone without a word ends the connection within a minute.
void serve_promptly(boost::asio::ip::tcp::socket& socket);
// Once more after something was received or sent, either of which ends it. A client that leaves Nagle's algorithm on
// sends its next small frame when the one before is acknowledged, and that is 40 ms later otherwise.
void acknowledge_at_once(boost::asio::ip::tcp::socket& socket);

// A client that has been silent so long makes room for a new one where all places are taken.
inline constexpr auto client_patience = std::chrono::seconds(2);

}  // namespace servodrome::links
