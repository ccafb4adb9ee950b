#pragma once

#include <cstdint>

// Whole numbers of a double within +-2^63, as std::floor and std::llround have them, to the last bit. Those are calls
// where the processor is not known to have an instruction for them, several in each cycle.
namespace servodrome::drive {

constexpr std::int64_t floor_to_integer(double value) {
  const auto whole = static_cast<std::int64_t>(value);
  return whole - (static_cast<double>(whole) > value ? 1 : 0);
}

// Halves away from zero.
constexpr std::int64_t round_to_integer(double value) {
  const auto whole = static_cast<std::int64_t>(value);
  const double rest = value - static_cast<double>(whole);
  return whole + (rest >= 0.5 ? 1 : 0) - (rest <= -0.5 ? 1 : 0);
}

// What floor_to_integer leaves out, 0 to 1.
constexpr double fraction_of(double value) { return value - static_cast<double>(floor_to_integer(value)); }

}  // namespace servodrome::drive
