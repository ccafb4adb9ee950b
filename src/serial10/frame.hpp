#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// The 10-byte frames of the Kinco iSMK's "RS232 protocol" (iSMK manual, ch. 8.4): id, command, index, sub-index, four
// bytes of data (all least significant byte first), checksum.
namespace servodrome::serial10 {

inline constexpr std::size_t frame_bytes = 10;
inline constexpr std::uint8_t universal_id = 127;  // every drive accepts it as its own (iSMK manual, ch. 4.1.2.2)

enum class Command : std::uint8_t {
  write_4 = 0x23,
  write_2 = 0x2B,
  write_1 = 0x2F,
  read = 0x40,
  // Answers
  read_4 = 0x43,
  read_2 = 0x4B,
  read_1 = 0x4F,
  written = 0x60,
  error = 0x80,
};

struct Frame {
  std::array<std::uint8_t, frame_bytes> bytes{};

  constexpr std::uint8_t id() const { return bytes[0]; }
  constexpr Command command() const { return static_cast<Command>(bytes[1]); }
  constexpr std::uint16_t index() const { return static_cast<std::uint16_t>(bytes[3] << 8 | bytes[2]); }
  constexpr std::uint8_t sub() const { return bytes[4]; }
  constexpr std::uint32_t data() const {
    return static_cast<std::uint32_t>(bytes[8]) << 24 | static_cast<std::uint32_t>(bytes[7]) << 16 |
           static_cast<std::uint32_t>(bytes[6]) << 8 | bytes[5];
  }
  // The sum of all ten bytes is 0 (iSMK manual, ch. 8.4.1).
  constexpr bool is_intact() const { return sum(frame_bytes) == 0; }

  static constexpr Frame make(std::uint8_t id, Command command, std::uint16_t index, std::uint8_t sub,
                              std::uint32_t data) {
    Frame frame;
    frame.bytes = {id,
                   static_cast<std::uint8_t>(command),
                   static_cast<std::uint8_t>(index),
                   static_cast<std::uint8_t>(index >> 8),
                   sub,
                   static_cast<std::uint8_t>(data),
                   static_cast<std::uint8_t>(data >> 8),
                   static_cast<std::uint8_t>(data >> 16),
                   static_cast<std::uint8_t>(data >> 24),
                   0};
    frame.bytes[9] = static_cast<std::uint8_t>(0x100U - frame.sum(frame_bytes - 1));
    return frame;
  }

  friend bool operator==(const Frame&, const Frame&) = default;

 private:
  constexpr std::uint8_t sum(std::size_t count) const {
    unsigned total = 0;
    for (std::size_t i = 0; i < count; ++i) total += bytes[i];
    return static_cast<std::uint8_t>(total);
  }
};

// Number of data bytes in a write command or a read answer; 0 for other commands.
constexpr std::uint8_t data_bytes(Command command) {
  switch (command) {
    case Command::write_4:
    case Command::read_4: return 4;
    case Command::write_2:
    case Command::read_2: return 2;
    case Command::write_1:
    case Command::read_1: return 1;
    default: return 0;
  }
}

}  // namespace servodrome::serial10
