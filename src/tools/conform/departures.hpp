#pragma once

#include <span>
#include <string_view>

#include "tools/conform/check.hpp"

namespace servodrome::master::conform {

// A documented departure: the product deviates from the standard, and its manual says so.
struct Departure {
  std::string_view product;  // name in the list of `servodrome products`
  std::string_view check;
  std::string_view reason;  // with the line of the manual
  // The departure applies to failed observations whose text (sent, expected or seen) contains this; empty: to every
  // failed observation of the check.
  std::string_view about{};
  std::string_view bus_variant{};  // another product with the same departure
};

std::span<const Departure> all_departures();

}  // namespace servodrome::master::conform
