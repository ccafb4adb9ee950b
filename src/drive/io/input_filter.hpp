#pragma once

#include <array>
#include <cstdint>

#include "drive/signals.hpp"

namespace servodrome::drive {

// Debounces inputs: a new level counts after it has lasted for a number of position-loop cycles.
class InputFilter {
 public:
  // Begins with these levels.
  void reset(std::uint32_t wires) {
    accepted_ = wires;
    lasting_ = {};
  }

  // One cycle; returns the accepted levels.
  std::uint32_t update(std::uint32_t wires, std::uint32_t cycles) {
    const std::uint32_t differing = wires ^ accepted_;
    for (std::size_t i = 0; i < max_inputs; ++i) {
      if ((differing >> i & 1u) == 0) {
        lasting_[i] = 0;
      } else if (++lasting_[i] > cycles) {
        accepted_ ^= 1u << i;
        lasting_[i] = 0;
      }
    }
    return accepted_;
  }

 private:
  std::uint32_t accepted_ = 0;
  std::array<std::uint32_t, max_inputs> lasting_{};
};

}  // namespace servodrome::drive
