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

}  // namespace servodrome::links
