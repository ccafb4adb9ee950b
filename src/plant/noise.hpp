#pragma once

#include <array>
#include <cstdint>

namespace servodrome::plant {

// Pseudo-random noise from a seed, the same on every machine (splitmix64 by Steele, Lea and Flood, 2014).
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : state_(seed) {}

  // Four values of mean 0 and standard deviation 1. Each is a sum of two uniform values: nearly normal, at most 2.45.
  std::array<float, 4> four() {
    const std::uint64_t first = next();
    const std::uint64_t second = next();
    constexpr float deviation = 26754.9F;  // 65536 / sqrt 6
    std::array<float, 4> result{};
    for (unsigned i = 0; i < 4; ++i) {
      const auto one = static_cast<std::int32_t>(first >> 16 * i & 0xFFFFU);
      const auto other = static_cast<std::int32_t>(second >> 16 * i & 0xFFFFU);
      result[i] = static_cast<float>(one - other) * (1.0F / deviation);
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
