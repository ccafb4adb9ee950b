#include <array>
#include <fmt/format.h>

#include "catalogue/cia402/status_rows.hpp"
#include "catalogue/list.hpp"
#include "catalogue/pronet/fault_texts.hpp"
#include "catalogue/pronet/object_texts.hpp"
#include "catalogue/pronet/terminals.hpp"

namespace servodrome::catalogue::pronet {
namespace {

// The period in microseconds (manual, ch. 7.5.4).
constexpr std::array cycle_objects{CycleObject{{0x2105, 0}, 4, [](std::chrono::nanoseconds period) -> std::int64_t {
                                                 return period / std::chrono::microseconds(1);
                                               }}};

// Velocity in 0.1 rpm, acceleration in 0.1 rpm/s, position in increments of one of four encoders (manual, ch. 4).
// Homing methods that search for an index do not work with serial encoders (ch. 7.2).
constexpr Dialect dialect{.units = AxisUnits{131072.0, 600.0, 600.0},
                          .encoder_counts = ObjectAddress{0x2F12, 0},
                          .has_old_factors = true,
                          .cautious_homing_method = 35,
                          .cycle_objects = cycle_objects,
                          .alarm_log = 0x3200,  // Fn000-0 .. 9
                          .alarm_log_length = 10};

// Pn703 bit rate and Pn704 node-ID; Pn006, Pn201 and Pn202 also take effect at the next power-on. All Pn are stored as
// soon as they are written.
constexpr auto connection = std::to_array<ObjectRange>({{0x30FF}, {0x3100}});
constexpr auto restart = std::to_array<ObjectRange>({{0x3006}, {0x2F10}, {0x2F11}});

std::string alarm_name(std::uint16_t alarm) { return fmt::format("A {:02X}", alarm); }

// Manual, ch. 6.2.2: bits 8 and 9 are not used.
constexpr auto status_words =
    cia402::joined(cia402::state_bits, cia402::common, cia402::cyclic, cia402::homing, cia402::profiles);

// CANopen user's manual V1.04
constexpr std::array departures{
    Departure{"identity.supported-modes", "there is no 6502h (object dictionary in the appendix)", "6502h"},
    Departure{"power.remote", "bits 8 and 9 of the statusword are not used (ch. 6.2.2)", "bit 9"},
    Departure{"pdo.rpdo-mapping-while-valid", "a valid PDO may be mapped anew (ch. 3.3, 'PDO mapping case')"},
    Departure{"pdo.tpdo-mapping-while-valid", "a valid PDO may be mapped anew (ch. 3.3, 'PDO mapping case')"},
};

}  // namespace

constinit const Product product{
    .name = "pronet",
    .dialect = dialect,
    .rules = {.connection = connection, .restart = restart},
    .fault_texts = fault_texts,
    .alarm_name = alarm_name,
    .object_texts = object_texts,
    .status_words = status_words,
    .mode_names = cia402::mode_names,
    .terminal_words = terminal_words,
    .departures = departures,
};

}  // namespace servodrome::catalogue::pronet
