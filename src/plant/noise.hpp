#pragma once

#include <bit>
#include <cstdint>

namespace servodrome::plant {

// A vector register of the processor (SIMD): one instruction computes all four.
using FourFloats [[gnu::vector_size(16)]] = float;

// Pseudo-random noise from a seed, the same on every machine (splitmix64 by Steele, Lea and Flood, 2014).
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : state_(seed) {}

  // Four values of mean 0 and standard deviation 1. Each is a sum of two uniform values: nearly normal, at most 2.45.
  FourFloats four() {
    using FourShorts [[gnu::vector_size(8)]] = std::uint16_t;
    static_assert(std::endian::native == std::endian::little);
    using FourInts [[gnu::vector_size(16)]] = std::int32_t;
    const auto first = __builtin_convertvector(std::bit_cast<FourShorts>(next()), FourInts);
    const auto second = __builtin_convertvector(std::bit_cast<FourShorts>(next()), FourInts);
    constexpr float deviation = 26754.9F;  // 65536 / sqrt 6
    return __builtin_convertvector(first - second, FourFloats) * (1.0F / deviation);
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
