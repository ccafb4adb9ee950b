#pragma once

#include <span>
#include <string_view>

#include "host/conform/check.hpp"

namespace servodrome::host::conform {

// Where a product is not as the standard says because its manual says so.
struct Departure {
  std::string_view product;  // as `servodrome products` lists it
  std::string_view check;
  std::string_view reason;  // with the manual's line
  // What is not met must contain this, sent, expected or seen; empty: whatever is not met in this check.
  std::string_view about{};
  std::string_view bus_variant{};  // another product of which the same holds
};

std::span<const Departure> all_departures();

}  // namespace servodrome::host::conform
