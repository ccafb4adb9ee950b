#pragma once

#include <array>
#include <cstddef>

namespace servodrome::dictionary {

// "RPDO 1 communication parameter" and so on: names that differ in a number.
template <std::size_t Count>
struct NumberedNames {
  std::array<std::array<char, 48>, Count> text{};

  constexpr NumberedNames(const char* before, const char* after) {
    for (std::size_t i = 0; i < Count; ++i) {
      std::size_t length = 0;
      const auto put = [&](char c) { text[i][length++] = c; };
      for (const char* c = before; *c != 0; ++c) put(*c);
      const std::size_t number = i + 1;
      for (std::size_t divisor = 1000; divisor > 0; divisor /= 10) {
        if (number >= divisor) put(static_cast<char>('0' + number / divisor % 10));
      }
      for (const char* c = after; *c != 0; ++c) put(*c);
    }
  }
  constexpr const char* operator[](std::size_t i) const { return text[i].data(); }
};

}  // namespace servodrome::dictionary
