#pragma once

#include "links/serial/link.hpp"

// Pseudo terminals, which only POSIX systems have: elsewhere parse_serial_link() refuses their names.
namespace servodrome::links {

std::unique_ptr<SerialLink> open_pty_link(const PtyName& name, SerialLine& line, boost::asio::io_context& io,
                                          LineHost& host);

}  // namespace servodrome::links
