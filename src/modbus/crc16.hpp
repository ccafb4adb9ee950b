#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace servodrome::modbus {

// CRC-16 of RTU frames: x^16 + x^15 + x^2 + 1, start value FFFFh, least significant bit first, sent low byte first
// (Modbus over Serial Line V1.02, 2.5.1.2 and appendix B). The check value of "123456789" is 4B37h.
inline constexpr auto crc16_table = [] {
  std::array<std::uint16_t, 256> table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? crc >> 1 ^ 0xA001U : crc >> 1;
    table[byte] = static_cast<std::uint16_t>(crc);
  }
  return table;
}();

constexpr std::uint16_t crc16(std::span<const std::uint8_t> bytes, std::uint16_t crc = 0xFFFF) {
  for (const std::uint8_t byte : bytes) {
    const auto row = static_cast<std::uint8_t>(crc ^ byte);
    crc = static_cast<std::uint16_t>(crc >> 8 ^ crc16_table[row]);
  }
  return crc;
}

}  // namespace servodrome::modbus
