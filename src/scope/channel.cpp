#include "scope/channel.hpp"

#include <cmath>
#include <cstdint>
#include <fmt/format.h>

namespace servodrome::scope {

std::string text_of_number(double number) {
  constexpr double exact = 9007199254740992.0;  // 2^53: all integers below it are exact in a double
  if (std::abs(number) < exact && number == std::floor(number)) {
    return fmt::format("{}", static_cast<std::int64_t>(number));
  }
  return fmt::format("{:.10g}", number);
}

}  // namespace servodrome::scope
