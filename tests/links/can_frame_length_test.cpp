#include <algorithm>
#include <array>
#include <gtest/gtest.h>
#include <random>
#include <string>

#include "links/can/frame_length.hpp"

namespace servodrome::links {
namespace can_frame_length_test {
namespace {

using canopen::Frame;

// An independent encoder, written from the standard's description without the code under test: the frame is a string of
// '0' and '1', the CRC a polynomial long division, stuffing a search for five equal characters.
std::string binary(std::uint64_t value, int bits) {
  std::string text;
  for (int i = bits - 1; i >= 0; --i) text += ((value >> i) & 1) != 0 ? '1' : '0';
  return text;
}

std::string crc_by_long_division(const std::string& message) {
  const std::string generator = "1100010110011001";  // x15+x14+x10+x8+x7+x4+x3+1
  std::string dividend = message + std::string(15, '0');
  for (std::size_t i = 0; i < message.size(); ++i) {
    if (dividend[i] == '0') continue;
    for (std::size_t k = 0; k < generator.size(); ++k) dividend[i + k] = dividend[i + k] == generator[k] ? '0' : '1';
  }
  return dividend.substr(message.size());
}

std::string reference(const Frame& frame) {
  std::string text = "0";
  const std::string remote = frame.remote ? "1" : "0";
  if (frame.extended) {
    text += binary(frame.id >> 18, 11) + "11" + binary(frame.id & 0x3FFFF, 18) + remote + "00";
  } else {
    text += binary(frame.id, 11) + remote + "00";
  }
  text += binary(frame.length, 4);
  for (int i = 0; !frame.remote && i < frame.length; ++i) text += binary(frame.data[static_cast<std::size_t>(i)], 8);
  text += crc_by_long_division(text);
  for (std::size_t i = 5; i <= text.size(); ++i) {
    const std::string last = text.substr(i - 5, 5);
    if (last == "00000") text.insert(i, "1");
    if (last == "11111") text.insert(i, "0");
  }
  return text + "1" + "01" + "1111111";
}

std::string as_text(const WireBits& wire) {
  std::string text;
  for (unsigned i = 0; i < wire.count; ++i) text += wire.levels[i] != 0 ? '1' : '0';
  return text;
}

Frame make(std::uint32_t id, std::initializer_list<std::uint8_t> bytes, bool extended = false) {
  Frame frame;
  frame.id = id;
  frame.extended = extended;
  frame.length = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

TEST(FrameLength, BruteForceAgainstIndependentStuffing) {
  std::mt19937 random(7);
  for (int i = 0; i < 20000; ++i) {
    Frame frame;
    frame.extended = random() % 2 != 0;
    frame.remote = random() % 5 == 0;
    frame.length = static_cast<std::uint8_t>(random() % 9);
    frame.id = static_cast<std::uint32_t>(random()) & (frame.extended ? 0x1FFFFFFFU : 0x7FFU);
    // Mostly 00 and FF, which cause the most stuff bits.
    for (auto& byte : frame.data) {
      const auto kind = random() % 4;
      byte = static_cast<std::uint8_t>(kind == 0 ? 0x00 : kind == 1 ? 0xFF : random());
    }
    const std::string expected = reference(frame);
    ASSERT_EQ(as_text(encode_frame(frame)), expected) << std::hex << frame.id;
    ASSERT_EQ(frame_length_bits(frame), expected.size());
  }
}

// The lengths without stuff bits in the standard, and the documented worst case: 34 + 8n bits can need (34 + 8n - 1) /
// 4 stuff bits.
TEST(FrameLength, StaysWithinTheStandardsBounds) {
  std::mt19937 random(3);
  for (const bool extended : {false, true}) {
    for (unsigned length = 0; length <= 8; ++length) {
      const unsigned stuffable = (extended ? 54U : 34U) + 8U * length;
      const unsigned shortest = stuffable + 10;
      unsigned longest_seen = 0;
      unsigned shortest_seen = 1000;
      for (int i = 0; i < 5000; ++i) {
        Frame frame;
        frame.extended = extended;
        frame.length = static_cast<std::uint8_t>(length);
        frame.id = static_cast<std::uint32_t>(random()) & (extended ? 0x1FFFFFFFU : 0x7FFU);
        for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(random());
        longest_seen = std::max(longest_seen, frame_length_bits(frame));
        shortest_seen = std::min(shortest_seen, frame_length_bits(frame));
      }
      EXPECT_GE(shortest_seen, shortest);
      EXPECT_LE(longest_seen, shortest + (stuffable - 1) / 4);
    }
  }
}

// Timing calculations use 135 bits, with interframe space, for the longest base frame. That is only an upper bound: the
// control bits IDE, r0 and DLC = 8 interrupt the pattern of one stuff bit every four bits. A search over identifiers
// and repeating patterns found at most 133 bits.
TEST(FrameLength, LongestBaseFrameIsJustBelow135BitsWithInterframeSpace) {
  constexpr unsigned bound = 44 + 64 + (34 + 64 - 1) / 4 + interframe_space_bits;
  static_assert(bound == 135);
  const Frame longest = make(0x000, {0x01, 0xE1, 0xE1, 0xE1, 0xE1, 0xE1, 0xE1, 0xE1});
  EXPECT_EQ(frame_length_bits(longest) + interframe_space_bits, 133U);
  EXPECT_EQ(reference(longest).size() + interframe_space_bits, 133U);
}

// Calculated independently of this program, bit by bit from the standard.
TEST(FrameLength, KnownFrames) {
  EXPECT_EQ(crc_by_long_division(""), "000000000000000");
  // A check of the independent encoder: CRC-15/CAN of "123456789" is 059E (catalogue of parametrised CRC algorithms).
  std::string digits;
  for (char digit = '1'; digit <= '9'; ++digit) digits += binary(static_cast<std::uint64_t>(digit), 8);
  EXPECT_EQ(crc_by_long_division(digits), binary(0x059E, 15));

  EXPECT_EQ(frame_crc15(make(0x080, {})), 0x1C05);
  EXPECT_EQ(as_text(encode_frame(make(0x080, {}))),
            "00001000001000001000001011100000100101"
            "1011111111");
  EXPECT_EQ(frame_crc15(make(0x123, {0x11, 0x22})), 0x04B7);
  EXPECT_EQ(frame_length_bits(make(0x123, {0x11, 0x22})), 62U);
  EXPECT_EQ(frame_length_bits(make(0x000, {0, 0, 0, 0, 0, 0, 0, 0})), 124U);
  EXPECT_EQ(frame_length_bits(make(0x7FF, {255, 255, 255, 255, 255, 255, 255, 255})), 123U);
  // Alternating data need stuff bits only in the control field and the CRC.
  EXPECT_EQ(frame_length_bits(make(0x555, {0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55})), 109U);
}

TEST(FrameLength, RemoteFrameCarriesNoData) {
  Frame remote = make(0x701, {1, 2, 3, 4, 5, 6, 7, 8});
  remote.remote = true;
  Frame empty = remote;
  empty.data = {};
  EXPECT_EQ(frame_length_bits(remote), frame_length_bits(empty));
  EXPECT_LE(frame_length_bits(remote), 44U + 33U / 4U);
}

TEST(ArbitrationKey, IsTheOrderOfTheWire) {
  Frame data = make(0x123, {});
  Frame remote = data;
  remote.remote = true;
  Frame extended = make(0x123U << 18U, {}, true);
  Frame extended_remote = extended;
  extended_remote.remote = true;
  const Frame later = make(0x124, {});
  EXPECT_LT(arbitration_key(data), arbitration_key(remote));
  EXPECT_LT(arbitration_key(remote), arbitration_key(extended));
  EXPECT_LT(arbitration_key(extended), arbitration_key(extended_remote));
  EXPECT_LT(arbitration_key(extended_remote), arbitration_key(later));

  // Compared with the encoded bits: at the first difference the frame with the dominant bit wins.
  std::mt19937 random(11);
  for (int i = 0; i < 5000; ++i) {
    std::array<Frame, 2> pair;
    for (Frame& frame : pair) {
      frame.extended = random() % 2 != 0;
      frame.remote = random() % 2 != 0;
      const std::uint32_t base = 0x120U + static_cast<std::uint32_t>(random()) % 4U;
      frame.id = frame.extended ? (base << 18U) | (static_cast<std::uint32_t>(random()) % 4U) : base;
    }
    const auto one = as_text(encode_frame(pair[0]));
    const auto other = as_text(encode_frame(pair[1]));
    if (one == other) continue;
    ASSERT_EQ(arbitration_key(pair[0]) < arbitration_key(pair[1]), one < other);
  }
}

}  // namespace
}  // namespace can_frame_length_test
}  // namespace servodrome::links
