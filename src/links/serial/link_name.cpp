#include "links/serial/link_name.hpp"

namespace servodrome::links {
namespace {

struct SerialLinkText {
  std::string operator()(const PtyName& name) const { return scheme::pty.with(name.path); }
  std::string operator()(const TtyName& name) const { return scheme::serial.with(name.device); }
  std::string operator()(const ModbusTcpName& name) const { return scheme::tcp.with(links::to_string(name.endpoint)); }
  std::string operator()(const MemName&) const { return scheme::mem.with(""); }
};

}  // namespace

SerialLinkName parse_serial_link(std::string_view text) {
  const LinkText link{"serial", text};
  link.refuse_absent();
  if (const auto rest = link.rest()) {
    if (link.scheme() == scheme::pty.name) return PtyName{parse_path(link, *rest, scheme::pty)};
    if (link.scheme() == scheme::serial.name) return TtyName{parse_path(link, *rest, scheme::serial)};
    if (link.scheme() == scheme::tcp.name)
      return ModbusTcpName{parse_endpoint(link, *rest, default_modbus_tcp_port, scheme::tcp)};
    if (link.scheme() == scheme::mem.name) return parse_mem(link, *rest);
  }
  link.refuse_scheme(serial_schemes);
}

std::string to_string(const SerialLinkName& name) { return std::visit(SerialLinkText{}, name); }

}  // namespace servodrome::links
