#pragma once

#include <array>
#include <cstdint>

#include "products/jmc_ec/communication_alarms.hpp"

// The states of the drive's lamps (ch. 4.3.2, Table 10). The board or the web page makes the lamps blink.
namespace servodrome::products::jmc_ec {

enum class Lamp : std::uint8_t { off, on, flashing, single_flash };

struct Leds {
  // The pair of lamps for the drive
  Lamp power = Lamp::off;          // green: on, or flashing while the bus is not linked (C-03)
  std::uint8_t alarm_flashes = 0;  // red, in groups; 0: see alarm_on
  bool alarm_on = false;           // red, steady: an alarm without a flash count
  // The lamps for the bus
  Lamp run = Lamp::off;  // green: Init off, Pre-Op flashing, Safe-Op single flash, Op on
  ErrorLed error = ErrorLed::off;
  Lamp data_in = Lamp::off;  // yellow: link on, traffic flashing (C-07)
  Lamp data_out = Lamp::off;

  friend bool operator==(const Leds&, const Leds&) = default;
};

inline constexpr std::uint8_t ccw_limit_flashes = 6;
inline constexpr std::uint8_t cw_limit_flashes = 7;
inline constexpr std::uint8_t origin_flashes = 8;

// Flashes of the red lamp for alarm numbers (FaultRow::alarm) from `first` to `last`.
struct AlarmFlashes {
  std::uint16_t first;
  std::uint16_t last;
  std::uint8_t flashes;
};
inline constexpr auto alarm_flashes = std::to_array<AlarmFlashes>({
    {0x051, 0x051, 11},   // EEPROM read or write error
    {0x060, 0x060, 14},   // current range wrong
    {0x062, 0x062, 11},   // storing a parameter failed
    {0x063, 0x063, 1},    // over-current
    {0x105, 0x105, 12},   // electronic gear setting wrong
    {0x110, 0x110, 13},   // power cycle needed after parameter change
    {0x401, 0x401, 3},    // supply under-voltage
    {0x402, 0x402, 2},    // supply over-voltage
    {0x410, 0x412, 10},   // overload
    {0x501, 0x501, 4},    // position out of tolerance
    {0x610, 0x622, 9},    // encoder error
    {0x941, 0x941, 13},   // power cycle needed after parameter change
    {0xE601, 0xE62B, 5},  // communication error
});

// Number of flashes for an alarm; 0: the manual prints none.
constexpr std::uint8_t flashes_of(std::uint16_t alarm) {
  for (const AlarmFlashes& row : alarm_flashes) {
    if (alarm >= row.first && alarm <= row.last) return row.flashes;
  }
  return 0;
}

// "AL.051", "E105", "E62B"; "" without a number.
using AlarmText = std::array<char, 7>;
constexpr AlarmText alarm_text(std::uint16_t alarm) {
  constexpr const char* digits = "0123456789ABCDEF";
  if (alarm == 0) return {};
  AlarmText text{};
  std::size_t n = 0;
  if (alarm >= 0xE000) {
    text[n++] = 'E';
  } else {
    text[n++] = 'A';
    text[n++] = 'L';
    text[n++] = '.';
  }
  for (const unsigned shift : {8U, 4U, 0U}) text[n++] = digits[alarm >> shift & 0xFU];
  return text;
}

}  // namespace servodrome::products::jmc_ec
