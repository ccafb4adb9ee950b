#include "links/can/link_name.hpp"

#include <charconv>
#include <fmt/format.h>
#include <optional>

#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

constexpr std::string_view socketcand_form = "socketcand:HOST:PORT/BUS, for example socketcand:127.0.0.1:29536/can0";
constexpr std::string_view slcan_form = "slcan:PATH, for example slcan:/run/servodrome/can0";
constexpr std::string_view socketcan_form = "socketcan:INTERFACE, for example socketcan:vcan0";
constexpr std::size_t longest_bus_name = 16;
constexpr std::size_t longest_interface_name = 15;  // IFNAMSIZ less the terminating zero

[[noreturn]] void refuse(std::string_view text, std::string_view what, std::string_view form) {
  throw LinkError(std::make_error_code(std::errc::invalid_argument),
                  fmt::format("CAN link \"{}\": {}; write {}", text, what, form));
}

std::optional<std::uint16_t> port_number(std::string_view digits) {
  unsigned value = 0;
  const char* end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, value);
  if (digits.empty() || error != std::errc{} || stop != end || value > 65535) return std::nullopt;
  return static_cast<std::uint16_t>(value);
}

bool is_plain_word(std::string_view word) {
  for (const char c : word) {
    if (c <= ' ' || c == '<' || c == '>' || c == '/' || c == 0x7F) return false;
  }
  return !word.empty();
}

SocketcandName parse_socketcand(std::string_view text, std::string_view rest) {
  SocketcandName name{"", 29536, "can0"};
  if (const auto slash = rest.find('/'); slash != std::string_view::npos) {
    name.bus = std::string(rest.substr(slash + 1));
    rest = rest.substr(0, slash);
    if (!is_plain_word(name.bus) || name.bus.size() > longest_bus_name) {
      refuse(text, "the bus after \"/\" must be a word of 1 to 16 characters", socketcand_form);
    }
  }
  std::string_view host = rest;
  std::string_view port;
  bool has_port = false;
  if (!rest.empty() && rest.front() == '[') {
    const auto close = rest.find(']');
    if (close == std::string_view::npos) refuse(text, "the address has no closing \"]\"", socketcand_form);
    host = rest.substr(1, close - 1);
    const std::string_view behind = rest.substr(close + 1);
    if (!behind.empty() && behind.front() != ':') {
      refuse(text, "only \":PORT\" may follow the address in brackets", socketcand_form);
    }
    has_port = !behind.empty();
    if (has_port) port = behind.substr(1);
  } else if (const auto colon = rest.find(':'); colon != std::string_view::npos) {
    host = rest.substr(0, colon);
    port = rest.substr(colon + 1);
    has_port = true;
    if (port.find(':') != std::string_view::npos) {
      refuse(text, "an IPv6 address stands in brackets, as in [::1]:29536", socketcand_form);
    }
  }
  if (host.empty()) refuse(text, "there is no host", socketcand_form);
  if (!is_plain_word(host)) refuse(text, fmt::format("\"{}\" is no host name or address", host), socketcand_form);
  name.host = std::string(host);
  if (has_port) {
    const auto number = port_number(port);
    if (!number) refuse(text, fmt::format("port \"{}\" is not a number from 0 to 65535", port), socketcand_form);
    name.port = *number;
  }
  return name;
}

struct ToString {
  std::string operator()(const SocketcandName& name) const {
    const bool is_v6 = name.host.find(':') != std::string::npos;
    return fmt::format("socketcand:{}{}{}:{}/{}", is_v6 ? "[" : "", name.host, is_v6 ? "]" : "", name.port, name.bus);
  }
  std::string operator()(const SlcanName& name) const { return "slcan:" + name.path; }
  std::string operator()(const SocketcanName& name) const { return "socketcan:" + name.interface; }
  std::string operator()(const MemName&) const { return "mem:"; }
};

}  // namespace

CanLinkName parse_can_link(std::string_view text) {
  const auto colon = text.find(':');
  const std::string_view scheme = text.substr(0, colon);
  const std::string_view rest = colon == std::string_view::npos ? std::string_view() : text.substr(colon + 1);
  if (colon != std::string_view::npos) {
    if (scheme == "socketcand") return parse_socketcand(text, rest);
    if (scheme == "slcan") {
      if (rest.empty()) refuse(text, "there is no path", slcan_form);
      if (rest.find('\0') != std::string_view::npos) refuse(text, "the path contains a zero byte", slcan_form);
      return SlcanName{std::string(rest)};
    }
    if (scheme == "socketcan") {
      if (!is_plain_word(rest) || rest.size() > longest_interface_name) {
        refuse(text, "the interface must be a word of 1 to 15 characters", socketcan_form);
      }
      return SocketcanName{std::string(rest)};
    }
    if (scheme == "mem") {
      if (!rest.empty()) refuse(text, "nothing may follow the colon", "mem:");
      return MemName{};
    }
  }
  refuse(text,
         colon == std::string_view::npos ? "there is no \":\"" : fmt::format("\"{}\" is no kind of CAN link", scheme),
         "one of socketcand:HOST:PORT/BUS, slcan:PATH, socketcan:INTERFACE, mem:");
}

std::string to_string(const CanLinkName& name) { return std::visit(ToString{}, name); }

}  // namespace servodrome::links
