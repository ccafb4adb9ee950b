#include "links/can/frame_length.hpp"

#include <algorithm>

namespace servodrome::links {
namespace {

constexpr std::uint32_t base_identifier_bits = 11;
constexpr std::uint32_t identifier_extension_bits = 18;

// Collects the bits of a frame up to the CRC, which both the CRC and the bit stuffing need.
class BitWriter {
 public:
  void put(std::uint32_t value, unsigned bits) {
    while (bits-- > 0) levels_[count_++] = static_cast<std::uint8_t>((value >> bits) & 1U);
  }

  std::uint16_t crc15() const {
    std::uint32_t crc = 0;
    for (unsigned i = 0; i < count_; ++i) {
      const std::uint32_t feedback = levels_[i] ^ ((crc >> 14U) & 1U);
      crc = ((crc << 1U) & 0x7FFFU) ^ (feedback != 0 ? 0x4599U : 0U);
    }
    return static_cast<std::uint16_t>(crc);
  }

  // Adds a bit of the opposite level after each five equal bits; stuff bits count among the five.
  WireBits stuffed() const {
    WireBits wire;
    unsigned run = 0;
    std::uint8_t previous = 2;
    for (unsigned i = 0; i < count_; ++i) {
      const std::uint8_t level = levels_[i];
      run = level == previous ? run + 1 : 1;
      previous = level;
      wire.levels[wire.count++] = level;
      if (run == 5) {
        previous = static_cast<std::uint8_t>(1U - level);
        wire.levels[wire.count++] = previous;
        run = 1;
      }
    }
    return wire;
  }

 private:
  std::array<std::uint8_t, 118> levels_{};  // extended, 8 bytes, with CRC
  unsigned count_ = 0;
};

BitWriter header_and_data(const canopen::Frame& frame) {
  BitWriter bits;
  const std::uint32_t remote = frame.remote ? 1U : 0U;
  bits.put(0, 1);  // start of frame
  if (frame.extended) {
    bits.put(frame.id >> identifier_extension_bits, base_identifier_bits);
    bits.put(3, 2);  // substitute remote request and identifier extension, both recessive
    bits.put(frame.id, identifier_extension_bits);
    bits.put(remote, 1);
    bits.put(0, 2);  // r1, r0
  } else {
    bits.put(frame.id, base_identifier_bits);
    bits.put(remote, 1);
    bits.put(0, 2);  // identifier extension, r0
  }
  const std::uint8_t length = std::min<std::uint8_t>(frame.length, 8);
  bits.put(length, 4);
  if (!frame.remote) {
    for (unsigned i = 0; i < length; ++i) bits.put(frame.data[i], 8);
  }
  return bits;
}

}  // namespace

WireBits encode_frame(const canopen::Frame& frame) {
  BitWriter bits = header_and_data(frame);
  bits.put(bits.crc15(), 15);
  WireBits wire = bits.stuffed();
  const auto put = [&wire](std::uint8_t level) { wire.levels[wire.count++] = level; };
  put(1);  // CRC delimiter
  put(0);  // acknowledge slot
  put(1);  // acknowledge delimiter
  for (int i = 0; i < 7; ++i) put(1);
  return wire;
}

unsigned frame_length_bits(const canopen::Frame& frame) { return encode_frame(frame).count; }

std::uint16_t frame_crc15(const canopen::Frame& frame) { return header_and_data(frame).crc15(); }

std::uint32_t arbitration_key(const canopen::Frame& frame) {
  const std::uint32_t remote = frame.remote ? 1U : 0U;
  if (!frame.extended) return (frame.id << 21U) | (remote << 20U);
  const std::uint32_t base = frame.id >> identifier_extension_bits;
  const std::uint32_t extension = frame.id & 0x3FFFFU;
  return (base << 21U) | (3U << 19U) | (extension << 1U) | remote;
}

}  // namespace servodrome::links
