#include "links/link_scheme.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <iterator>
#include <vector>

#include "links/system_schemes.hpp"

namespace servodrome::links {
namespace {

template <typename Text>
std::string list(LinkSchemes schemes, std::string_view last, Text text) {
  std::vector<LinkScheme> here;
  std::copy_if(schemes.begin(), schemes.end(), std::back_inserter(here),
               [](const LinkScheme& scheme) { return absence_of(scheme.name).empty(); });
  std::string all;
  for (const LinkScheme& scheme : here) {
    if (!all.empty()) all += &scheme == &here.back() ? last : ", ";
    all += text(scheme);
  }
  return all;
}

}  // namespace

std::string LinkScheme::help() const {
  if (example.empty()) return std::string(form);
  return fmt::format("{}, for example {}{}", form, example_here(*this), also);
}

std::string LinkScheme::with(std::string_view rest) const { return fmt::format("{}:{}", name, rest); }

bool is_any_of(LinkSchemes schemes, std::string_view link) {
  return std::any_of(schemes.begin(), schemes.end(), [&](const LinkScheme& scheme) { return scheme.is_of(link); });
}

std::string forms(LinkSchemes schemes, std::string_view last) {
  return list(schemes, last, [](const LinkScheme& scheme) { return scheme.form; });
}

std::string client_forms(LinkSchemes schemes, std::string_view last) {
  return list(schemes, last, [](const LinkScheme& scheme) { return scheme.client_form; });
}

std::string prefixes(LinkSchemes schemes, std::string_view last) {
  return list(schemes, last, [](const LinkScheme& scheme) { return scheme.with(""); });
}

}  // namespace servodrome::links
