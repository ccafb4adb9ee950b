#pragma once

#include <cstdint>

#include "modbus/time.hpp"

// Format of a character on the wire, and the pauses that separate frames.
namespace servodrome::modbus {

enum class Parity : std::uint8_t { none, even, odd };

// The default is the standard's (Modbus over Serial Line V1.02, 2.5.1): 19200 bit/s, 8 data bits, even parity.
struct CharacterFormat {
  std::uint32_t bit_rate = 19200;  // bit/s, not 0
  std::uint8_t data_bits = 8;
  Parity parity = Parity::even;
  std::uint8_t stop_bits = 1;

  // Start bit, data, parity, stop bits: 10 for 8N1, 11 for 8E1 and 8N2.
  constexpr unsigned bits() const { return 1U + data_bits + (parity == Parity::none ? 0U : 1U) + stop_bits; }
  // Length of `halves` half characters: the pauses are 1.5 and 3.5 characters.
  constexpr Time half_characters(std::int64_t halves) const {
    return Time{halves * bits() * 1'000'000'000 / (2 * static_cast<std::int64_t>(bit_rate))};
  }
  constexpr Time character_time() const { return half_characters(2); }

  friend bool operator==(const CharacterFormat&, const CharacterFormat&) = default;
};

// The pauses of RTU framing.
struct RtuTiming {
  Time character{};        // length of one character
  Time inter_character{};  // a longer pause within a frame makes it invalid; 0: pauses are not checked
  Time silence{};          // ends a frame

  friend bool operator==(const RtuTiming&, const RtuTiming&) = default;
};

// 1.5 and 3.5 characters at every bit rate.
constexpr RtuTiming character_timing(const CharacterFormat& format) {
  return {format.character_time(), format.half_characters(3), format.half_characters(7)};
}

// The same up to 19200 bit/s; above, the fixed 750 us and 1.75 ms that the standard recommends (2.5.1.1).
constexpr RtuTiming standard_timing(const CharacterFormat& format) {
  if (format.bit_rate <= 19200) return character_timing(format);
  return {format.character_time(), std::chrono::microseconds(750), std::chrono::microseconds(1750)};
}

// For a station whose pauses come from an operating system instead of a wire: a frame ends after at least `silence`,
// and pauses within it are not checked. `silence` 0 leaves `timing` unchanged.
constexpr RtuTiming at_least(Time silence, RtuTiming timing) {
  if (silence <= Time{0}) return timing;
  timing.inter_character = Time{0};
  if (timing.silence < silence) timing.silence = silence;
  return timing;
}

}  // namespace servodrome::modbus
