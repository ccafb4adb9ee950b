#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <string>

#include "links/link_text.hpp"

namespace servodrome::links {

// A socket that listens at `endpoint`; port 0: one the system chooses. Throws LinkError about the link `name`.
boost::asio::ip::tcp::acceptor listen_at(boost::asio::io_context& io, const Endpoint& endpoint,
                                         const std::string& name);

}  // namespace servodrome::links
