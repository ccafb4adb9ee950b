#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace servodrome::canopen {

// CRC-16 of SDO block transfers: x^16 + x^12 + x^5 + 1, start value 0, most significant bit first (CiA 301 7.2.4.3.16).
// The check value of "123456789" is 31C3h.
inline constexpr auto crc16_table = [] {
  std::array<std::uint16_t, 256> table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte << 8;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x8000U) != 0 ? crc << 1 ^ 0x1021U : crc << 1;
    table[byte] = static_cast<std::uint16_t>(crc);
  }
  return table;
}();

constexpr std::uint16_t crc16(std::span<const std::byte> data, std::uint16_t crc = 0) {
  for (const std::byte byte : data) {
    const auto row = static_cast<std::uint8_t>((crc >> 8) ^ std::to_integer<unsigned>(byte));
    crc = static_cast<std::uint16_t>((crc << 8) ^ crc16_table[row]);
  }
  return crc;
}

}  // namespace servodrome::canopen
