#pragma once

#include <cstdint>
#include <gtest/gtest.h>
#include <sstream>
#include <string>
#include <vector>

#include "dictionary/dictionary.hpp"
#include "dictionary/table.hpp"

// The objects of the iSMK in the manual's examples, without a drive.
namespace servodrome::test {

struct IsmkObjects {
  std::uint8_t store = 0;
  std::int16_t target_speed_rpm = 0;
  std::uint8_t motor_utilization = 0;
  std::uint8_t drive_utilization = 0;
  std::uint16_t controlword = 6;
  std::uint16_t statusword = 0;
  std::uint16_t quick_stop = 0;
  std::uint16_t shutdown = 0;
  std::int8_t mode = 0;
  std::int32_t position = 0;
  std::int32_t target_position = 0;
  std::uint32_t profile_speed = 0;
  std::uint32_t profile_acceleration = 0;
  std::uint32_t profile_deceleration = 0;
  std::int8_t homing_method = 0;
  std::uint32_t homing_speed_switch = 0;
  std::uint32_t homing_speed_zero = 0;
  std::int32_t target_speed = 0;
  std::uint8_t protocol = 0;
};

inline constexpr auto ismk_table = dictionary::make_table<[] {
  using namespace dictionary;
  using O = IsmkObjects;
  TableBuilder<40> t;
  const auto record = ObjectCode::record;
  t.add(text_constant(0x1008, "Device name", "iSMK60-040"));
  t.add(highest_sub(0x2FF0, record, "Storage", 0x11));
  t.add(element(0x2FF0, 0x01, record, "", SERVODROME_FIELD(O, store), Access::rw));
  t.add(element(0x2FF0, 0x09, record, "", SERVODROME_FIELD(O, target_speed_rpm), Access::rw));
  t.add(element(0x2FF0, 0x10, record, "", SERVODROME_FIELD(O, motor_utilization), Access::ro));
  t.add(element(0x2FF0, 0x11, record, "", SERVODROME_FIELD(O, drive_utilization), Access::ro));
  t.add(var(0x6040, "", SERVODROME_FIELD(O, controlword), Access::rw));
  t.add(var(0x6041, "", SERVODROME_FIELD(O, statusword), Access::ro));
  t.add(var(0x605A, "", SERVODROME_FIELD(O, quick_stop), Access::rw, Pdo::none, {.minimum = 0, .maximum = 18}));
  t.add(var(0x605B, "", SERVODROME_FIELD(O, shutdown), Access::rw, Pdo::none, {.minimum = 0, .maximum = 18}));
  t.add(var(0x6060, "", SERVODROME_FIELD(O, mode), Access::rw, Pdo::none, {.minimum = -4, .maximum = 7}));
  t.add(var(0x6063, "", SERVODROME_FIELD(O, position), Access::ro));
  t.add(var(0x607A, "", SERVODROME_FIELD(O, target_position), Access::rw));
  t.add(var(0x6081, "", SERVODROME_FIELD(O, profile_speed), Access::rw));
  t.add(var(0x6083, "", SERVODROME_FIELD(O, profile_acceleration), Access::rw));
  t.add(var(0x6084, "", SERVODROME_FIELD(O, profile_deceleration), Access::rw));
  t.add(var(0x6098, "", SERVODROME_FIELD(O, homing_method), Access::rw));
  t.add(highest_sub(0x6099, record, "Homing speeds", 2));
  t.add(element(0x6099, 1, record, "", SERVODROME_FIELD(O, homing_speed_switch), Access::rw));
  t.add(element(0x6099, 2, record, "", SERVODROME_FIELD(O, homing_speed_zero), Access::rw));
  t.add(var(0x60FF, "", SERVODROME_FIELD(O, target_speed), Access::rw));
  t.add(highest_sub(0x6510, record, "Drive", 0x0C));
  t.add(element(0x6510, 0x0C, record, "", SERVODROME_FIELD(O, protocol), Access::rw, Pdo::none,
                {.minimum = 0, .maximum = 3}));
  return t;
}>();
static_assert(dictionary::is_valid_table(ismk_table));

struct IsmkDevice {
  IsmkObjects objects;
  dictionary::Dictionary dictionary{ismk_table, std::as_writable_bytes(std::span(&objects, 1))};
};

// Formats bytes as the manuals do.
inline std::vector<std::uint8_t> bytes_of(const std::string& hex) {
  std::vector<std::uint8_t> bytes;
  std::istringstream text(hex);
  for (unsigned byte = 0; text >> std::hex >> byte;) bytes.push_back(static_cast<std::uint8_t>(byte));
  EXPECT_TRUE(text.eof()) << hex;
  return bytes;
}
inline std::string hex_of(std::span<const std::uint8_t> bytes) {
  static constexpr char digits[] = "0123456789ABCDEF";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    if (!text.empty()) text += ' ';
    text += digits[byte >> 4];
    text += digits[byte & 15];
  }
  return text;
}

}  // namespace servodrome::test
