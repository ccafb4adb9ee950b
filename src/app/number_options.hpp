#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <concepts>
#include <fmt/format.h>
#include <limits>

#include "app/commands.hpp"

// Numbers of the command line, which may also be "nan" and "1e300".
namespace servodrome::app {

// A number from `low` to `high`. CLI::Range would accept "nan".
inline CLI::Validator number_within(double low, double high) {
  return {[low, high](const std::string& text) -> std::string {
            double value = 0.0;
            if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return {};
            return fmt::format("{} is not a number from {} to {}", text, low, high);
          },
          ""};
}

// The duration of a command, which has the same name in all commands.
template <typename T>
CLI::Option* add_seconds_option(CLI::App& command, T& seconds, const std::string& description) {
  return command.add_option("--seconds", seconds, description);
}

// Rounds `units` to the type of a drive's object. Throws Failure if the type cannot hold it; the message begins with
// `option` and the given `number`.
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
