#include "links/serial/stream_link.hpp"
#include "links/serial/system_links.hpp"

namespace servodrome::links {

std::unique_ptr<SerialLink> open_pty_link(const PtyName& name, SerialLine& line, boost::asio::io_context& io,
                                          LineHost& host) {
  const auto open = [&](SerialStream::Owner& owner) { return open_adapter_stream(name.path, io, owner); };
  return std::make_unique<StreamLink>(to_string(name), open, line, io, host);
}

}  // namespace servodrome::links
