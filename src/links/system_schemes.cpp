#include "links/system_schemes.hpp"

namespace servodrome::links {

std::string_view absence_of(std::string_view /*scheme_name*/) { return {}; }

std::string_view example_here(const LinkScheme& scheme) { return scheme.example; }

}  // namespace servodrome::links
