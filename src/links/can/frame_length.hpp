#pragma once

#include <cstdint>

#include "canopen/frame.hpp"

namespace servodrome::links {

// Bits between the end of one frame and the earliest start of the next (ISO 11898-1, 10.4.6: intermission).
inline constexpr unsigned interframe_space_bits = 3;

// Length of a frame on the wire in bits, from start of frame to the last bit of end of frame, with the stuff bits its
// content really needs; without the interframe space. 44 + 8n (base) or 64 + 8n (extended) plus at most
// (34 + 8n - 1) / 4 or (54 + 8n - 1) / 4 stuff bits (ISO 11898-1, 10.4 and 10.5). A length above 8 counts as 8.
unsigned frame_length_bits(const canopen::Frame& frame);

// The 15-bit CRC over start of frame, arbitration, control and data field, without stuff bits (ISO 11898-1, 10.4.2.6,
// generator 0x4599).
std::uint16_t frame_crc15(const canopen::Frame& frame);

// The arbitration field as it appears on the wire, left-aligned so that of two frames the one with the smaller key
// wins: lower identifier first, then data before remote, base before extended (ISO 11898-1, 10.4.2.2 and 10.8).
std::uint32_t arbitration_key(const canopen::Frame& frame);

}  // namespace servodrome::links
