#include <array>
#include <fmt/format.h>

#include "catalogue/cia402/status_rows.hpp"
#include "catalogue/ismk/fault_texts.hpp"
#include "catalogue/ismk/gains.hpp"
#include "catalogue/ismk/object_texts.hpp"
#include "catalogue/ismk/terminals.hpp"
#include "catalogue/list.hpp"

namespace servodrome::catalogue::ismk {
namespace {

// 3011h sub 1: 0 to 3 stand for 1, 2, 4 and 8 ms; sub 2 = 1: the drive synchronises to the master's clock (manual,
// Table 9-27).
constexpr std::array cycle_objects{
    CycleObject{{0x3011, 1},
                1,
                [](std::chrono::nanoseconds period) {
                  std::int64_t exponent = 0;
                  while (exponent < 3 && std::chrono::milliseconds(1) * (1 << exponent) < period) ++exponent;
                  return exponent;
                }},
    CycleObject{{0x3011, 2}, 1, [](std::chrono::nanoseconds) { return std::int64_t{1}; }}};

// Error_State, Error_State2 and their extension (manual, ch. 10.1).
constexpr std::array alarm_words{AlarmWord{{0x2601, 0}, 0}, AlarmWord{{0x2602, 0}, 16}, AlarmWord{{0x2605, 7}, 32}};

// Homing: bit 15 attained, bit 12 error, bit 10 stays 0 (manual, Table 5-5, ch. 8.3.2); home offset: Table 5-14; units:
// appendix II; in 607Dh sub 1 is the positive limit.
constexpr Dialect dialect{.homing_signals = {.attained = 1U << 15, .error = 1U << 12, .target_reached = false},
                          .home_offset = {.travels = true, .stays_with_1 = ObjectAddress{0x6099, 5}},
                          .units = AxisUnits{65536.0, 60.0 * 512.0 * 65536.0 / 1875.0, 65536.0 * 65536.0 / 4'000'000.0},
                          .cautious_homing_method = 33,
                          .software_limits = {.lowest = 2, .highest = 1},
                          .brake_delay = ObjectAddress{0x6410, 0x12},
                          .cycle_objects = cycle_objects,
                          .alarm_words = alarm_words};

// Simulated inputs and outputs, copies of other objects in different units, and pointers to objects. 2FF0h sub 1 stores
// everything except the motor data, sub 3 stores these (manual, ch. 7.10).
constexpr auto commands = std::to_array<ObjectRange>({{0x2010, 0x02, 0x02},
                                                      {0x2010, 0x0E, 0x0E},
                                                      {0x2690},
                                                      {0x2FF0},
                                                      {0x2FF1},
                                                      {0x2FFF},
                                                      {0x60F6, 0x08, 0x08},
                                                      {0x60F9, 0x28, 0x28}});
constexpr auto connection = std::to_array<ObjectRange>({{0x100B}, {0x2F81}, {0x2FE2}, {0x6510, 0x0B, 0x0C}});
constexpr std::array store{StoreCommand{{0x2FF0, 1}, 1}, StoreCommand{{0x2FF0, 3}, 1}};

// The display of the drive shows a word of bits in hexadecimal, with a point before the last digit.
std::string alarm_name(std::uint16_t alarm) {
  const unsigned bit = alarm & 15U;
  if (alarm >= 32) return fmt::format("2605h sub 7 bit {}", bit);
  const unsigned word = 1U << bit;
  return fmt::format("{} bit {} ({:03X}.{:X})", alarm < 16 ? "2601h" : "2602h", bit, word >> 4U, word & 15U);
}

// Manual, Table 5-5.
constexpr auto status_words = cia402::joined(
    cia402::state_bits, std::array{StatusWord{10, "", 6}}, cia402::remote, cia402::common, cia402::cyclic,
    std::array{StatusWord{12, "homing error", 6}, StatusWord{12, "set-point acknowledge", 1},
               StatusWord{12, "speed is zero", 3}, StatusWord{12, "speed is zero", -3},
               StatusWord{12, "interpolation active", 7}, StatusWord{13, "following error"},
               StatusWord{14, "commutation found"}, StatusWord{15, "home found"}});

// Manual, object 6060h.
constexpr auto mode_names =
    cia402::joined(std::array{ModeName{-4, "pulse"}, ModeName{-3, "immediate velocity"}}, cia402::mode_names);

constexpr std::array departures{
    Departure{"power.transition-11", "the statusword of quick stop active ends in 50h (Table 5-2)", "50h"},
    Departure{"power.transition-12", "the statusword of quick stop active ends in 50h (Table 5-2)", "50h"},
    Departure{"power.transition-16", "the statusword of quick stop active ends in 50h (Table 5-2)", "50h"},
    Departure{"homing.attained", "bit 15 is homing attained, bit 12 is homing error (Table 5-5)", "bit 15"},
    Departure{"homing.attained", "bit 10 stays 0 at the end of homing (ch. 8.3.2)", "bit 10"},
    Departure{"homing.offset",
              "the axis travels by 607Ch and shows 0 there, unless 6099h sub 5 is 1 (Table 5-14, ch. 7.6)", "6064h"},
    Departure{"ip.data-record", "the targets of mode 7 are in 607Ah (Table 9-27)", "60C1h"},
    Departure{"nmt.heartbeat-consumer",
              "with 6007h = 0, its factory value, the loss of the master is ignored (Table 9-26)", "8130h"},
    Departure{"pdo.reserved-type", "types 241 to 251 are taken (ch. 9.3.3.3)", "245"},
    Departure{"modbus.no-address", "a refused read is answered with function 81h (ch. 8.3.1)", "81 02"},
    Departure{"modbus.wrong-count", "a refused read is answered with function 81h (ch. 8.3.1)", "81 03"},
};

// The EtherCAT variant is the same drive on another bus.
constexpr Product of_bus(std::string_view name) {
  return {
      .name = name,
      .dialect = dialect,
      .rules = {.commands = commands, .connection = connection, .store = store},
      .tuning = tuning,
      .gain_guide = gain_guide,
      .fault_texts = fault_texts,
      .alarm_name = alarm_name,
      .object_texts = object_texts,
      .status_words = status_words,
      .mode_names = mode_names,
      .terminal_words = terminal_words,
      .departures = departures,
  };
}

}  // namespace

constinit const Product product = of_bus("ismk");
constinit const Product ethercat_product = of_bus("ismk-ea");

}  // namespace servodrome::catalogue::ismk
