#include "links/link_text.hpp"

#include <fmt/format.h>

#include "links/link_error.hpp"
#include "links/number_text.hpp"
#include "links/system_schemes.hpp"

namespace servodrome::links {
namespace {

std::optional<std::uint16_t> port_number(std::string_view digits) { return number_of_text<std::uint16_t>(digits); }

[[noreturn]] void refuse_text(const LinkText& link, std::string_view what, std::string_view form) {
  throw LinkError(std::make_error_code(std::errc::invalid_argument),
                  fmt::format("{} link {:?}: {}; write {}", link.bus, link.text, what, form));
}

}  // namespace

std::optional<std::string_view> LinkText::rest() const {
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) return std::nullopt;
  return text.substr(colon + 1);
}

void LinkText::refuse_absent() const {
  const std::string_view absence = absence_of(scheme());
  if (absence.empty()) return;
  throw LinkError(std::make_error_code(std::errc::invalid_argument),
                  fmt::format("{} link {:?}: {}", bus, text, absence));
}

void LinkText::refuse(std::string_view what, const LinkScheme& scheme) const {
  refuse_text(*this, what, scheme.help());
}

void LinkText::refuse_scheme(LinkSchemes schemes) const {
  refuse_text(*this, rest() ? fmt::format("\"{}\" is not a kind of {} link", scheme(), bus) : "there is no \":\"",
              fmt::format("one of {}, {}", forms(schemes), scheme::mem.form));
}

MemName parse_mem(const LinkText& link, std::string_view rest) {
  if (!rest.empty()) link.refuse("nothing may follow the colon", scheme::mem);
  return MemName{};
}

std::string parse_path(const LinkText& link, std::string_view rest, const LinkScheme& scheme) {
  if (rest.empty()) link.refuse("there is no path", scheme);
  if (rest.find('\0') != std::string_view::npos) link.refuse("the path contains a zero byte", scheme);
  return std::string(rest);
}

void refuse_mem_link(const char* bus, LinkSchemes schemes) {
  throw LinkError(std::make_error_code(std::errc::invalid_argument),
                  fmt::format("{} link \"mem:\" is for a master in the same process and cannot be opened for others; "
                              "choose {} to let other programs in",
                              bus, prefixes(schemes)));
}

void refuse_mem_client(const char* bus, LinkSchemes schemes) {
  throw LinkError(std::make_error_code(std::errc::invalid_argument),
                  fmt::format("{} link \"mem:\" reaches a line in the same process only; name the line's {} link", bus,
                              prefixes(schemes)));
}

bool is_plain_word(std::string_view word) {
  for (const char c : word) {
    if (c <= ' ' || c == '<' || c == '>' || c == '/' || c == 0x7F) return false;
  }
  return !word.empty();
}

Endpoint parse_endpoint(const LinkText& link, std::string_view text, std::uint16_t default_port,
                        const LinkScheme& scheme) {
  std::string_view host = text;
  std::optional<std::string_view> port;
  if (!text.empty() && text.front() == '[') {
    const auto close = text.find(']');
    if (close == std::string_view::npos) link.refuse("the address has no closing \"]\"", scheme);
    host = text.substr(1, close - 1);
    const std::string_view behind = text.substr(close + 1);
    if (!behind.empty() && behind.front() != ':')
      link.refuse("only \":PORT\" may follow the address in brackets", scheme);
    if (!behind.empty()) port = behind.substr(1);
  } else if (const auto colon = text.find(':'); colon != std::string_view::npos) {
    host = text.substr(0, colon);
    port = text.substr(colon + 1);
    if (port->find(':') != std::string_view::npos) {
      link.refuse("an IPv6 address stands in brackets, as in [::1]:PORT", scheme);
    }
  }
  if (host.empty()) link.refuse("there is no host", scheme);
  if (!is_plain_word(host) || host.find_first_of("[]") != std::string_view::npos)
    link.refuse(fmt::format("\"{}\" is not a host name or address", host), scheme);
  if (!port) return {std::string(host), default_port};
  const auto number = port_number(*port);
  if (!number) link.refuse(fmt::format("port \"{}\" is not a number from 0 to 65535", *port), scheme);
  return {std::string(host), *number};
}

std::string to_string(const Endpoint& endpoint) {
  const bool is_v6 = endpoint.host.find(':') != std::string::npos;
  return fmt::format("{}{}{}:{}", is_v6 ? "[" : "", endpoint.host, is_v6 ? "]" : "", endpoint.port);
}

}  // namespace servodrome::links
