#pragma once

#include <cstdint>

// Conversions of a double within +-2^63 to integers, with exactly the results of std::floor and std::llround. Those
// are library calls unless the compiler may use an instruction for them, and each cycle needs several.
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

// The part that floor_to_integer omits, 0 to 1.
constexpr double fraction_of(double value) { return value - static_cast<double>(floor_to_integer(value)); }

}  // namespace servodrome::drive
