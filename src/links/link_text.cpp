#include "links/link_text.hpp"

#include <charconv>
#include <fmt/format.h>

#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

std::optional<std::uint16_t> port_number(std::string_view digits) {
  unsigned value = 0;
  const char* end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, value);
  if (digits.empty() || error != std::errc{} || stop != end || value > 65535) return std::nullopt;
  return static_cast<std::uint16_t>(value);
}

}  // namespace

std::optional<std::string_view> LinkText::rest() const {
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) return std::nullopt;
  return text.substr(colon + 1);
}

void LinkText::refuse(std::string_view what, std::string_view form) const {
  throw LinkError(std::make_error_code(std::errc::invalid_argument),
                  fmt::format("{} link {:?}: {}; write {}", bus, text, what, form));
}

void LinkText::refuse_scheme(std::string_view forms) const {
  refuse(rest() ? fmt::format("\"{}\" is not a kind of {} link", scheme(), bus) : "there is no \":\"",
         fmt::format("one of {}", forms));
}

bool is_plain_word(std::string_view word) {
  for (const char c : word) {
    if (c <= ' ' || c == '<' || c == '>' || c == '/' || c == 0x7F) return false;
  }
  return !word.empty();
}

Endpoint parse_endpoint(const LinkText& link, std::string_view text, std::uint16_t default_port,
                        std::string_view form) {
  std::string_view host = text;
  std::optional<std::string_view> port;
  if (!text.empty() && text.front() == '[') {
    const auto close = text.find(']');
    if (close == std::string_view::npos) link.refuse("the address has no closing \"]\"", form);
    host = text.substr(1, close - 1);
    const std::string_view behind = text.substr(close + 1);
    if (!behind.empty() && behind.front() != ':')
      link.refuse("only \":PORT\" may follow the address in brackets", form);
    if (!behind.empty()) port = behind.substr(1);
  } else if (const auto colon = text.find(':'); colon != std::string_view::npos) {
    host = text.substr(0, colon);
    port = text.substr(colon + 1);
    if (port->find(':') != std::string_view::npos) {
      link.refuse("an IPv6 address stands in brackets, as in [::1]:PORT", form);
    }
  }
  if (host.empty()) link.refuse("there is no host", form);
  if (!is_plain_word(host)) link.refuse(fmt::format("\"{}\" is not a host name or address", host), form);
  if (!port) return {std::string(host), default_port};
  const auto number = port_number(*port);
  if (!number) link.refuse(fmt::format("port \"{}\" is not a number from 0 to 65535", *port), form);
  return {std::string(host), *number};
}

std::string to_string(const Endpoint& endpoint) {
  const bool is_v6 = endpoint.host.find(':') != std::string::npos;
  return fmt::format("{}{}{}:{}", is_v6 ? "[" : "", endpoint.host, is_v6 ? "]" : "", endpoint.port);
}

}  // namespace servodrome::links
