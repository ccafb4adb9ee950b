#include "links/can/link_name.hpp"

#include <fmt/format.h>

namespace servodrome::links {
namespace {

constexpr std::uint16_t default_port = 29536;
constexpr std::size_t longest_bus_name = 16;

SocketcandName parse_socketcand(const LinkText& link, std::string_view rest) {
  std::string bus = "can0";
  if (const auto slash = rest.find('/'); slash != std::string_view::npos) {
    bus = std::string(rest.substr(slash + 1));
    rest = rest.substr(0, slash);
    if (!is_plain_word(bus) || bus.size() > longest_bus_name) {
      link.refuse("the bus after \"/\" must be a word of 1 to 16 characters", scheme::socketcand);
    }
  }
  const Endpoint endpoint = parse_endpoint(link, rest, default_port, scheme::socketcand);
  return {endpoint.host, endpoint.port, bus};
}

struct CanLinkText {
  std::string operator()(const SocketcandName& name) const {
    return scheme::socketcand.with(fmt::format("{}/{}", links::to_string(Endpoint{name.host, name.port}), name.bus));
  }
  std::string operator()(const SlcanName& name) const { return scheme::slcan.with(name.path); }
  std::string operator()(const SocketcanName& name) const { return scheme::socketcan.with(name.interface); }
  std::string operator()(const MemName&) const { return scheme::mem.with(""); }
};

}  // namespace

CanLinkName parse_can_link(std::string_view text) {
  const LinkText link{"CAN", text};
  link.refuse_absent();
  if (const auto rest = link.rest()) {
    if (link.scheme() == scheme::socketcand.name) return parse_socketcand(link, *rest);
    if (link.scheme() == scheme::slcan.name) return SlcanName{parse_path(link, *rest, scheme::slcan)};
    if (link.scheme() == scheme::socketcan.name) {
      if (!is_plain_word(*rest) || rest->size() > longest_interface_name) {
        link.refuse("the interface must be a word of 1 to 15 characters", scheme::socketcan);
      }
      return SocketcanName{std::string(*rest)};
    }
    if (link.scheme() == scheme::mem.name) return parse_mem(link, *rest);
  }
  link.refuse_scheme(can_schemes);
}

std::string to_string(const CanLinkName& name) { return std::visit(CanLinkText{}, name); }

}  // namespace servodrome::links
