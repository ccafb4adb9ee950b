#pragma once

#include <cstdint>

// Every Modbus frame of the iSMK manual (ch. 8.3). The manual prints only the first word of the two status replies.
namespace servodrome::modbus::test {

struct IsmkExample {
  const char* what;
  const char* request;
  const char* response;  // nullptr: the response equals the request
  std::uint16_t index;
  std::uint8_t sub;
  std::int64_t value;  // value after the request; if the request reads it, also before
};

inline constexpr IsmkExample ismk_examples[] = {
    {"RS232 protocol at once", "01 06 86 C0 00 01 61 7E", nullptr, 0x6510, 0x0C, 1},
    {"RS232 protocol after saving", "01 06 86 C0 00 03 E0 BF", nullptr, 0x6510, 0x0C, 3},
    {"store control parameters", "01 06 29 10 00 01 41 93", nullptr, 0x2FF0, 1, 1},
    {"target speed 30 rpm", "01 10 6F 00 00 02 04 55 55 00 08 1A 47", "01 10 6F 00 00 02 5C DC", 0x60FF, 0, 0x85555},
    {"mode 3", "01 06 35 00 00 03 C6 07", nullptr, 0x6060, 0, 3},
    {"150 rpm", "01 10 6F 00 00 02 04 F5 C3 00 28 D9 B3", "01 10 6F 00 00 02 5C DC", 0x60FF, 0, 0x28F5C3},
    {"enable", "01 06 31 00 00 0F C7 32", nullptr, 0x6040, 0, 0x0F},
    {"status, homing found", "01 03 32 00 00 02 CA B3", "01 03 04 C0 37 FF FF 76 4D", 0x6041, 0, 0xC037},
    {"mode 6", "01 06 35 00 00 06 06 04", nullptr, 0x6060, 0, 6},
    {"homing method 33", "01 06 4D 00 00 21 5E BE", nullptr, 0x6098, 0, 33},
    {"homing speed 200 rpm", "01 10 50 10 00 02 04 9D 03 00 36 51 1A", "01 10 50 10 00 02 51 0D", 0x6099, 1, 0x369D03},
    {"zero speed 150 rpm", "01 10 50 20 00 02 04 F5 C3 00 28 CE 5A", "01 10 50 20 00 02 51 02", 0x6099, 2, 0x28F5C3},
    {"start homing", "01 06 31 00 00 1F C6 FE", nullptr, 0x6040, 0, 0x1F},
    {"mode 1", "01 06 35 00 00 01 47 C6", nullptr, 0x6060, 0, 1},
    {"target position 50000", "01 10 40 00 00 02 04 C3 50 00 00 FE 39", "01 10 40 00 00 02 54 08", 0x607A, 0, 50000},
    {"profile speed 30 rpm", "01 10 4A 00 00 02 04 55 55 00 08 BC D6", "01 10 4A 00 00 02 57 D0", 0x6081, 0, 0x85555},
    {"controlword 2F", "01 06 31 00 00 2F C6 EA", nullptr, 0x6040, 0, 0x2F},
    {"controlword 3F", "01 06 31 00 00 3F C7 26", nullptr, 0x6040, 0, 0x3F},
    {"controlword 4F", "01 06 31 00 00 4F C6 C2", nullptr, 0x6040, 0, 0x4F},
    {"controlword 5F", "01 06 31 00 00 5F C7 0E", nullptr, 0x6040, 0, 0x5F},
    {"status, position reached", "01 03 32 00 00 02 CA B3", "01 03 04 D4 37 FF FF 73 BD", 0x6041, 0, 0xD437},
};
// The frame with a misprinted CRC (Table 8-1, register 5020; ismk_examples has the correct one).
inline constexpr const char* ismk_wrong_crc = "01 10 50 10 00 02 04 9D 03 00 36 57 98";

}  // namespace servodrome::modbus::test
