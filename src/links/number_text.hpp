#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>
#include <type_traits>

namespace servodrome::links {

// Reads a number that is the whole text: without spaces, "+" or "0x". Empty if the text is anything else, or if the
// number does not fit into the type. `base` is for integers.
template <typename Number>
std::optional<Number> number_of_text(std::string_view text, [[maybe_unused]] int base = 10) {
  Number value{};
  const char* const last = text.data() + text.size();
  std::from_chars_result read{};
  if constexpr (std::is_integral_v<Number>) {
    read = std::from_chars(text.data(), last, value, base);
  } else {
    read = std::from_chars(text.data(), last, value);
  }
  if (read.ec != std::errc{} || read.ptr != last) return std::nullopt;
  return value;
}

}  // namespace servodrome::links
