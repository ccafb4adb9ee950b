#pragma once

#include <array>
#include <cstdint>

#include "canopen/time.hpp"

namespace servodrome::canopen {

// A classical CAN frame (ISO 11898-1). CANopen uses base (11-bit) identifiers only; a node ignores extended frames.
struct Frame {
  std::uint32_t id = 0;  // 11 or 29 bits, without flags
  bool extended = false;
  bool remote = false;                            // RTR: no data, `length` is the requested length
  std::uint8_t length = 0;                        // 0..8
  alignas(8) std::array<std::uint8_t, 8> data{};  // aligned: copied as one word

  friend bool operator==(const Frame&, const Frame&) = default;
};

// A frame to be sent, and the time since when it waits.
struct WaitingFrame {
  Frame frame;
  Time since{0};
};

}  // namespace servodrome::canopen
