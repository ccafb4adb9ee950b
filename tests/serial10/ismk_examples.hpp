#pragma once

#include <cstdint>

// Every frame of the iSMK manual's "RS232 protocol" (ch. 8.4.1 and 8.4.2); the manual does not print the checksums of
// the two status replies.
namespace servodrome::serial10 {

struct IsmkExample {
  const char* what;
  const char* request;
  const char* answer;
  std::int64_t value;  // value of the object after the request; if the request reads it, also before
};

inline constexpr IsmkExample ismk_examples[] = {
    {"read 2FF0.09", "01 40 F0 2F 09 00 00 00 00 97", "01 4B F0 2F 09 58 02 00 00 32", 600},
    {"write 2FF0.09", "01 2B F0 2F 09 58 02 00 00 52", "01 60 F0 2F 09 58 02 00 00 1D", 600},
    {"controlword 0F", "01 2B 40 60 00 0F 00 00 00 25", "01 60 40 60 00 0F 00 00 00 F0", 0x0F},
    {"mode 6", "01 2F 60 60 00 06 00 00 00 0A", "01 60 60 60 00 06 00 00 00 D9", 6},
    {"method 33", "01 2F 98 60 00 21 00 00 00 B7", "01 60 98 60 00 21 00 00 00 86", 33},
    {"6099.01 = 200 rpm", "01 23 99 60 01 03 9D 36 00 0C", "01 60 99 60 01 03 9D 36 00 CF", 0x369D03},
    {"6099.02 = 100 rpm", "01 23 99 60 02 82 4E 1B 00 F6", "01 60 99 60 02 82 4E 1B 00 B9", 0x1B4E82},
    {"controlword 1F", "01 2B 40 60 00 1F 00 00 00 15", "01 60 40 60 00 1F 00 00 00 E0", 0x1F},
    {"status after homing", "01 40 41 60 00 00 00 00 00 1E", "01 4B 41 60 00 31 C0 FF FF 24", 0xC031},
    {"controlword 2F", "01 2B 40 60 00 2F 00 00 00 05", "01 60 40 60 00 2F 00 00 00 D0", 0x2F},
    {"controlword 4F", "01 2B 40 60 00 4F 00 00 00 E5", "01 60 40 60 00 4F 00 00 00 B0", 0x4F},
    {"mode 1", "01 2F 60 60 00 01 00 00 00 0F", "01 60 60 60 00 01 00 00 00 DE", 1},
    {"607A = 50000", "01 23 7A 60 00 50 C3 00 00 EF", "01 60 7A 60 00 50 C3 00 00 B2", 50000},
    {"6081 = 200 rpm", "01 23 81 60 00 03 9D 36 00 25", "01 60 81 60 00 03 9D 36 00 E8", 0x369D03},
    {"6083 = 100 rps/s", "01 23 83 60 00 6E A3 01 00 E7", "01 60 83 60 00 6E A3 01 00 AA", 107374},
    {"6084 = 100 rps/s", "01 23 84 60 00 6E A3 01 00 E6", "01 60 84 60 00 6E A3 01 00 A9", 107374},
    {"controlword 3F", "01 2B 40 60 00 3F 00 00 00 F5", "01 60 40 60 00 3F 00 00 00 C0", 0x3F},
    {"controlword 5F", "01 2B 40 60 00 5F 00 00 00 D5", "01 60 40 60 00 5F 00 00 00 A0", 0x5F},
    {"position reached", "01 40 41 60 00 00 00 00 00 1E", "01 4B 41 60 00 37 C4 FF FF 1A", 0xC437},
    {"mode 3", "01 2F 60 60 00 03 00 00 00 0D", "01 60 60 60 00 03 00 00 00 DC", 3},
    {"60FF = -100 rpm", "01 23 FF 60 00 7E B1 E4 FF 6B", "01 60 FF 60 00 7E B1 E4 FF 2E", -1789570},
};

}  // namespace servodrome::serial10
