#include "links/ethercat/link_name.hpp"

#include <fmt/format.h>

namespace servodrome::links {
namespace {

std::string interface_name(const LinkText& link, std::string_view text) {
  if (!is_plain_word(text) || text.size() > longest_interface_name) {
    link.refuse("an interface must be a word of 1 to 15 characters", scheme::raw);
  }
  return std::string(text);
}

// Removes the word behind the last comma from `rest`. Returns true if it is "busy", false if there is no comma.
bool take_busy(const LinkText& link, std::string_view& rest, const LinkScheme& scheme) {
  const auto comma = rest.rfind(',');
  if (comma == std::string_view::npos) return false;
  if (rest.substr(comma + 1) != "busy") link.refuse("only \"busy\" may follow a comma", scheme);
  rest = rest.substr(0, comma);
  return true;
}

RawName parse_raw(const LinkText& link, std::string_view rest) {
  RawName name;
  name.busy = take_busy(link, rest, scheme::raw);
  const auto plus = rest.find('+');
  name.interface = interface_name(link, rest.substr(0, plus));
  if (plus == std::string_view::npos) return name;
  name.secondary = interface_name(link, rest.substr(plus + 1));
  if (*name.secondary == name.interface) link.refuse("a ring has two interfaces", scheme::raw);
  return name;
}

EthercatUdpName parse_udp(const LinkText& link, std::string_view rest) {
  EthercatUdpName name;
  name.busy = take_busy(link, rest, scheme::udp);
  const Endpoint endpoint = parse_endpoint(link, rest, ethercat_udp_port, scheme::udp);
  name.host = endpoint.host;
  name.port = endpoint.port;
  return name;
}

struct EthercatLinkText {
  std::string operator()(const RawName& name) const {
    return scheme::raw.with(fmt::format("{}{}{}{}", name.interface, name.secondary ? "+" : "",
                                        name.secondary.value_or(""), suffix(name.busy)));
  }
  std::string operator()(const EthercatUdpName& name) const {
    return scheme::udp.with(links::to_string(Endpoint{name.host, name.port}) + suffix(name.busy));
  }
  std::string operator()(const MemName&) const { return scheme::mem.with(""); }
  static const char* suffix(bool busy) { return busy ? ",busy" : ""; }
};

}  // namespace

EthercatLinkName parse_ethercat_link(std::string_view text) {
  const LinkText link{"EtherCAT", text};
  link.refuse_absent();
  if (const auto rest = link.rest()) {
    if (link.scheme() == scheme::raw.name) return parse_raw(link, *rest);
    if (link.scheme() == scheme::udp.name) return parse_udp(link, *rest);
    if (link.scheme() == scheme::mem.name) return parse_mem(link, *rest);
  }
  link.refuse_scheme(ethercat_schemes);
}

std::string to_string(const EthercatLinkName& name) { return std::visit(EthercatLinkText{}, name); }

}  // namespace servodrome::links
