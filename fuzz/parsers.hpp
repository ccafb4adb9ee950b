#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <string_view>

// A fuzz target with several parsers: the first byte of an input selects one.
namespace servodrome::fuzz {

using Bytes = std::span<const std::uint8_t>;
using Parser = void (*)(Bytes input);

inline std::string_view text_of(Bytes bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

// Ends the program if an invariant does not hold.
inline void require(bool holds) {
  if (!holds) std::abort();
}

// Removes the first byte of `input`. 0: there is none.
inline std::uint8_t take_byte(Bytes& input) {
  if (input.empty()) return 0;
  const std::uint8_t byte = input.front();
  input = input.subspan(1);
  return byte;
}

// Removes the first `size` bytes of `input`, or all if it has fewer.
inline Bytes take_bytes(Bytes& input, std::size_t size) {
  const Bytes taken = input.first(std::min(size, input.size()));
  input = input.subspan(taken.size());
  return taken;
}

inline void parse_with(std::span<const Parser> parsers, Bytes input) {
  if (input.size() < 2) return;
  const Parser parse = parsers[take_byte(input) % parsers.size()];
  parse(input);
}

}  // namespace servodrome::fuzz
