#include "links/serial/link.hpp"

#include "links/serial/modbus_tcp_listener.hpp"
#include "links/serial/stream_link.hpp"
#include "links/serial/system_links.hpp"
#include "links/serial/tty.hpp"

namespace servodrome::links {
namespace {

struct OpenSerialLink {
  SerialLine& line;
  modbus::Units& units;
  boost::asio::io_context& io;
  LineHost& host;

  std::unique_ptr<SerialLink> operator()(const PtyName& name) const { return open_pty_link(name, line, io, host); }
  std::unique_ptr<SerialLink> operator()(const TtyName& name) const {
    const auto open = [&](SerialStream::Owner& owner) {
      return open_tty_stream(open_tty(name.device, line.format()), io, owner);
    };
    return std::make_unique<StreamLink>(to_string(name), open, line, io, host);
  }
  std::unique_ptr<SerialLink> operator()(const ModbusTcpName& name) const {
    return std::make_unique<ModbusTcpListener>(name, line, units, io, host);
  }
  std::unique_ptr<SerialLink> operator()(const MemName&) const { refuse_mem_link("serial", serial_schemes); }
};

}  // namespace

std::unique_ptr<SerialLink> open_serial_link(const SerialLinkName& name, SerialLine& line, modbus::Units& units,
                                             boost::asio::io_context& io, LineHost& host) {
  return std::visit(OpenSerialLink{line, units, io, host}, name);
}

}  // namespace servodrome::links
