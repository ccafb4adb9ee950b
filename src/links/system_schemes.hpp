#pragma once

#include <string_view>

#include "links/link_scheme.hpp"

// The schemes of link names on the system that the program is compiled for.
namespace servodrome::links {

// Describes why this system has no links of the scheme with this name, and what to use instead. Empty if it has them.
std::string_view absence_of(std::string_view scheme_name);
// The example for help texts, with device names of this system; usually scheme.example.
std::string_view example_here(const LinkScheme& scheme);

}  // namespace servodrome::links
