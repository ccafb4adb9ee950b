#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <concepts>
#include <fmt/format.h>
#include <limits>

#include "app/commands.hpp"

// Numbers of the command line, where "nan" and "1e300" are numbers as well.
namespace servodrome::app {

// A number from `low` to `high`. CLI::Range would let "nan" pass.
inline CLI::Validator number_within(double low, double high) {
  return {[low, high](const std::string& text) -> std::string {
            double value = 0.0;
            if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return {};
            return fmt::format("{} is not a number from {:g} to {:g}", text, low, high);
          },
          ""};
}

// `units`, rounded, as an object of the drive takes it. Throws Failure, which begins with `option` and the `number`
// given with it, if the type does not hold it.
template <std::integral T>
T whole_units(double units, const char* option, double number) {
  const double rounded = std::round(units);
  if (rounded >= static_cast<double>(std::numeric_limits<T>::min()) &&
      rounded <= static_cast<double>(std::numeric_limits<T>::max())) {
    return static_cast<T>(rounded);
  }
  throw Failure::wrong_use(fmt::format("{} {:g}: {:g} units are not within {} .. {}", option, number, rounded,
                                       std::numeric_limits<T>::min(), std::numeric_limits<T>::max()));
}

}  // namespace servodrome::app
