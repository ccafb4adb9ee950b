#include "links/can/link_name.hpp"

#include <fmt/format.h>

namespace servodrome::links {
namespace {

constexpr std::string_view socketcand_form = "socketcand:HOST:PORT/BUS, for example socketcand:127.0.0.1:29536/can0";
constexpr std::string_view slcan_form = "slcan:PATH, for example slcan:/run/servodrome/can0";
constexpr std::string_view socketcan_form = "socketcan:INTERFACE, for example socketcan:vcan0";
constexpr std::uint16_t default_port = 29536;
constexpr std::size_t longest_bus_name = 16;
constexpr std::size_t longest_interface_name = 15;  // IFNAMSIZ less the terminating zero

SocketcandName parse_socketcand(const LinkText& link, std::string_view rest) {
  std::string bus = "can0";
  if (const auto slash = rest.find('/'); slash != std::string_view::npos) {
    bus = std::string(rest.substr(slash + 1));
    rest = rest.substr(0, slash);
    if (!is_plain_word(bus) || bus.size() > longest_bus_name) {
      link.refuse("the bus after \"/\" must be a word of 1 to 16 characters", socketcand_form);
    }
  }
  const Endpoint endpoint = parse_endpoint(link, rest, default_port, socketcand_form);
  return {endpoint.host, endpoint.port, bus};
}

struct ToString {
  std::string operator()(const SocketcandName& name) const {
    return fmt::format("socketcand:{}/{}", links::to_string(Endpoint{name.host, name.port}), name.bus);
  }
  std::string operator()(const SlcanName& name) const { return "slcan:" + name.path; }
  std::string operator()(const SocketcanName& name) const { return "socketcan:" + name.interface; }
  std::string operator()(const MemName&) const { return "mem:"; }
};

}  // namespace

CanLinkName parse_can_link(std::string_view text) {
  const LinkText link{"CAN", text};
  if (const auto rest = link.rest()) {
    if (link.scheme() == "socketcand") return parse_socketcand(link, *rest);
    if (link.scheme() == "slcan") {
      if (rest->empty()) link.refuse("there is no path", slcan_form);
      if (rest->find('\0') != std::string_view::npos) link.refuse("the path contains a zero byte", slcan_form);
      return SlcanName{std::string(*rest)};
    }
    if (link.scheme() == "socketcan") {
      if (!is_plain_word(*rest) || rest->size() > longest_interface_name) {
        link.refuse("the interface must be a word of 1 to 15 characters", socketcan_form);
      }
      return SocketcanName{std::string(*rest)};
    }
    if (link.scheme() == "mem") {
      if (!rest->empty()) link.refuse("nothing may follow the colon", "mem:");
      return MemName{};
    }
  }
  link.refuse_scheme("socketcand:HOST:PORT/BUS, slcan:PATH, socketcan:INTERFACE, mem:");
}

std::string to_string(const CanLinkName& name) { return std::visit(ToString{}, name); }

}  // namespace servodrome::links
