#pragma once

#include <cstdint>

namespace servodrome::links {

// The random generator splitmix64: small, seedable, and the same on every platform (unlike the standard's
// distributions).
class DisturbanceGenerator {
 public:
  explicit constexpr DisturbanceGenerator(std::uint64_t seed) : state_(seed) {}

  constexpr std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t value = state_;
    value = (value ^ (value >> 30U)) * 0xBF58476D1CE4E5B9U;
    value = (value ^ (value >> 27U)) * 0x94D049BB133111EBU;
    return value ^ (value >> 31U);
  }

  // Returns true with the given probability. It always takes one draw, so the sequence does not depend on the
  // probability.
  constexpr bool chance(double probability) { return static_cast<double>(next() >> 11U) * 0x1.0p-53 < probability; }

 private:
  std::uint64_t state_;
};

}  // namespace servodrome::links
