#pragma once

#include <array>
#include <cstdint>

#include "canopen/frame.hpp"

namespace servodrome::links {

// Bits between the end of one frame and the earliest start of the next (ISO 11898-1, 10.4.6: intermission).
inline constexpr unsigned interframe_space_bits = 3;

// A frame as levels of the wire, one element per bit (0 dominant, 1 recessive), from start of frame to the last bit of
// end of frame. It includes stuff bits and a dominant acknowledge slot, but not the interframe space.
struct WireBits {
  static constexpr unsigned maximum = 157;  // extended, 8 bytes: 54 + 64 bits, 147 with stuff bits, and 10 more
  std::array<std::uint8_t, maximum> levels{};
  unsigned count = 0;
};

// A length above 8 counts as 8.
WireBits encode_frame(const canopen::Frame& frame);

// The number of bits of encode_frame(): 44 + 8n (base) or 64 + 8n (extended), plus the stuff bits that the content
// needs, at most (34 + 8n - 1) / 4 or (54 + 8n - 1) / 4 (ISO 11898-1, 10.4 and 10.5).
unsigned frame_length_bits(const canopen::Frame& frame);

// The 15-bit CRC over start of frame, arbitration, control and data field, without stuff bits (ISO 11898-1, 10.4.2.6,
// generator 0x4599).
std::uint16_t frame_crc15(const canopen::Frame& frame);

// The arbitration field as on the wire, left-aligned. Of two frames the one with the smaller key wins: lower identifier
// first, then data before remote, base before extended (ISO 11898-1, 10.4.2.2 and 10.8).
std::uint32_t arbitration_key(const canopen::Frame& frame);

}  // namespace servodrome::links
