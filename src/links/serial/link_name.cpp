#include "links/serial/link_name.hpp"

namespace servodrome::links {
namespace {

constexpr std::string_view pty_form = "pty:PATH, for example pty:/run/servodrome/axis3";
constexpr std::string_view serial_form = "serial:DEVICE, for example serial:/dev/ttyUSB0";
constexpr std::string_view tcp_form = "tcp:HOST:PORT, for example tcp:127.0.0.1:1502";

std::string parse_path(const LinkText& link, std::string_view rest, std::string_view form) {
  if (rest.empty()) link.refuse("there is no path", form);
  if (rest.find('\0') != std::string_view::npos) link.refuse("the path contains a zero byte", form);
  return std::string(rest);
}

struct ToString {
  std::string operator()(const PtyName& name) const { return "pty:" + name.path; }
  std::string operator()(const TtyName& name) const { return "serial:" + name.device; }
  std::string operator()(const ModbusTcpName& name) const { return "tcp:" + links::to_string(name.endpoint); }
  std::string operator()(const MemName&) const { return "mem:"; }
};

}  // namespace

SerialLinkName parse_serial_link(std::string_view text) {
  const LinkText link{"serial", text};
  if (const auto rest = link.rest()) {
    if (link.scheme() == "pty") return PtyName{parse_path(link, *rest, pty_form)};
    if (link.scheme() == "serial") return TtyName{parse_path(link, *rest, serial_form)};
    if (link.scheme() == "tcp") return ModbusTcpName{parse_endpoint(link, *rest, default_modbus_tcp_port, tcp_form)};
    if (link.scheme() == "mem") {
      if (!rest->empty()) link.refuse("nothing may follow the colon", "mem:");
      return MemName{};
    }
  }
  link.refuse_scheme("pty:PATH, serial:DEVICE, tcp:HOST:PORT, mem:");
}

std::string to_string(const SerialLinkName& name) { return std::visit(ToString{}, name); }

}  // namespace servodrome::links
