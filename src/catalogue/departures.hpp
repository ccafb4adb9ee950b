#pragma once

#include <string_view>

namespace servodrome::catalogue {

// A documented departure: the product deviates from the standard, and its manual says so.
struct Departure {
  std::string_view check;   // of `servodrome conform`
  std::string_view reason;  // with the place in the manual
  // The departure applies to failed observations whose text (sent, expected or seen) contains this; empty: to every
  // failed observation of the check.
  std::string_view about{};
};

}  // namespace servodrome::catalogue
