#include "axis/dialect.hpp"

#include <algorithm>
#include <array>

namespace servodrome::master {
namespace {

constexpr Dialect cia402{};

// The period in microseconds (ProNet manual, ch. 7.5.4).
constexpr std::array pronet_cycle_objects{CycleObject{
    {0x2105, 0}, 4, [](links::Time period) { return std::int64_t{period / std::chrono::microseconds(1)}; }}};

// 3011h sub 1: 0 to 3 stand for 1, 2, 4 and 8 ms; sub 2 = 1: the drive synchronises to the master's clock (iSMK manual,
// Table 9-27).
constexpr std::array ismk_cycle_objects{
    CycleObject{{0x3011, 1},
                1,
                [](links::Time period) {
                  std::int64_t exponent = 0;
                  while (exponent < 3 && std::chrono::milliseconds(1) * (1 << exponent) < period) ++exponent;
                  return exponent;
                }},
    CycleObject{{0x3011, 2}, 1, [](links::Time) { return std::int64_t{1}; }}};

// Error_State, Error_State2 and their extension (iSMK manual, ch. 10.1).
constexpr std::array ismk_alarm_words{AlarmWord{{0x2601, 0}, 0}, AlarmWord{{0x2602, 0}, 16},
                                      AlarmWord{{0x2605, 7}, 32}};

// Homing: bit 15 attained, bit 12 error, bit 10 stays 0 (iSMK manual, Table 5-5, ch. 8.3.2); home offset: Table 5-14;
// units: appendix II; in 607Dh sub 1 is the positive limit.
constexpr Dialect ismk(std::string_view product) {
  return {.product = product,
          .homing_signals = {.attained = 1U << 15, .error = 1U << 12, .target_reached = false},
          .home_offset = {.travels = true, .stays_with_1 = ObjectAddress{0x6099, 5}},
          .units = AxisUnits{65536.0, 60.0 * 512.0 * 65536.0 / 1875.0, 65536.0 * 65536.0 / 4'000'000.0},
          .cautious_homing_method = 33,
          .software_limits = {.lowest = 2, .highest = 1},
          .cycle_objects = ismk_cycle_objects,
          .alarm_words = ismk_alarm_words};
}

constexpr std::array dialects{
    Dialect{.product = "generic402"},
    Dialect{.product = "generic402-ec", .foe_file = "parameters.txt"},
    // Halt clears the buffer of set-points (ISMC manual, ch. 4.3.6, 'Point to point stop').
    Dialect{.product = "ismc", .halt_drops_target = true},
    // Velocity in 0.1 rpm, acceleration in 0.1 rpm/s, position in increments of one of four encoders (ProNet manual,
    // ch. 4). Homing methods that search for an index do not work with serial encoders (ch. 7.2).
    Dialect{.product = "pronet",
            .units = AxisUnits{131072.0, 600.0, 600.0},
            .encoder_counts = ObjectAddress{0x2F12, 0},
            .has_old_factors = true,
            .cautious_homing_method = 35,
            .cycle_objects = pronet_cycle_objects,
            .alarm_log = 0x3200,  // Fn000-0 .. 9
            .alarm_log_length = 10},
    ismk("ismk"),
    ismk("ismk-ea"),
    // The drive has methods 0 to 35 (JMC manual, object 6098h); home offset: Chart 42; 607Bh limits the change of a
    // target, so that positions never wrap around there (Table 227).
    Dialect{.product = "jmc_ec",
            .home_offset = {.travels = true},
            .cautious_homing_method = 35,
            .has_position_range = false},
};

}  // namespace

const Dialect& dialect_of(std::string_view product) {
  const auto* const found = std::find_if(dialects.begin(), dialects.end(),
                                         [product](const Dialect& dialect) { return dialect.product == product; });
  return found != dialects.end() ? *found : cia402;
}

}  // namespace servodrome::master
