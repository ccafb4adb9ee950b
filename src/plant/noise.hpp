#pragma once

#include <cmath>
#include <cstdint>

namespace servodrome::plant {

// Noise out of a seed, the same on every machine (splitmix64 by Steele, Lea and Flood, 2014).
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : state_(seed) {}

  // Mean 0, standard deviation 1, nearly normal: the sum of four even draws, so never beyond 3.5.
  double normal() {
    const std::uint64_t bits = next();
    const std::uint64_t pairs = (bits & 0x0000FFFF0000FFFFU) + (bits >> 16 & 0x0000FFFF0000FFFFU);
    const auto sum = static_cast<std::int64_t>((pairs & 0xFFFFFFFFU) + (pairs >> 32));
    const double deviation = std::sqrt(4.0 / 12.0) * 65536.0;
    return (static_cast<double>(sum) - 2.0 * 65535.0) / deviation;
  }
  // Even in -1 .. 1.
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
