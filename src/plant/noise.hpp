#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace servodrome::plant {

// Pseudo-random noise from a seed, the same on every machine (splitmix64 by Steele, Lea and Flood, 2014).
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : state_(seed) {}

  // Four values of mean 0 and standard deviation 1. Each is a sum of two uniform values: nearly normal, at most 2.45.
  std::array<float, 4> four() {
    using Quarters = std::array<std::uint16_t, 4>;
    static_assert(std::endian::native == std::endian::little);
    const auto first = std::bit_cast<Quarters>(next());
    const auto second = std::bit_cast<Quarters>(next());
    constexpr float deviation = 26754.9F;  // 65536 / sqrt 6
    std::array<float, 4> result;
    for (std::size_t i = 0; i < 4; ++i) {  // becomes vector instructions
      result[i] = static_cast<float>(std::int32_t{first[i]} - std::int32_t{second[i]}) * (1.0F / deviation);
    }
    return result;
  }
  // A uniform value in -1 .. 1.
  double even() { return static_cast<double>(next() >> 11) * 0x1p-52 - 1.0; }

 private:
  std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t mixed = state_;
    mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9U;
    mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBU;
    return mixed ^ (mixed >> 31);
  }

  std::uint64_t state_;
};

}  // namespace servodrome::plant
