#include <array>
#include <fmt/format.h>

#include "catalogue/cia402/status_rows.hpp"
#include "catalogue/jmc_ec/fault_texts.hpp"
#include "catalogue/jmc_ec/gains.hpp"
#include "catalogue/jmc_ec/object_texts.hpp"
#include "catalogue/jmc_ec/terminals.hpp"
#include "catalogue/list.hpp"

namespace servodrome::catalogue::jmc_ec {
namespace {

// The drive has methods 0 to 35 (manual, object 6098h); home offset: Chart 42; 607Bh limits the change of a target, so
// that positions never wrap around there (Table 227).
constexpr Dialect dialect{.home_offset = {.travels = true}, .cautious_homing_method = 35, .has_position_range = false};

// Objects of the service port: P00-21 to P00-27 and the functions; P00, P03-09 to P03-11 and P06 take effect at
// power-on (manual, ch. 9.2, AL.110). Objects of the bus cannot be stored; panel parameters are stored as soon as they
// are written.
constexpr auto commands = std::to_array<ObjectRange>({{0x200D}, {0x200E}});
constexpr auto connection = std::to_array<ObjectRange>({{0x2000, 0x16, 0x1C}});
constexpr auto restart = std::to_array<ObjectRange>({{0x2000}, {0x2003, 0x0A, 0x0C}, {0x2006}});

// Rated current and torque of the motor; P00, the motor data.
constexpr auto by_model = std::to_array<ObjectRange>({{0x2000}, {0x6075}, {0x6076}});

std::string alarm_name(std::uint16_t alarm) {
  return alarm < 0xE000 ? fmt::format("AL.{:03X}", alarm) : fmt::format("{:04X}", alarm);
}

// Manual, Tables 156, 222, 239, 250 and 264, and Chart 273.
constexpr auto status_words = cia402::joined(
    cia402::state_bits, cia402::cyclic, cia402::homing,
    std::array{StatusWord{8, "halt", 3}, StatusWord{9, "remote"}, StatusWord{10, "target reached"},
               StatusWord{11, "software limit active", 1}, StatusWord{11, "software limit active", 8},
               StatusWord{12, "set-point acknowledge", 1}, StatusWord{12, "command is being executed", 3},
               StatusWord{13, "following error", 1}, StatusWord{13, "following error", 3},
               StatusWord{13, "following error", 8}, StatusWord{13, "following error", 9}});

constexpr std::array departures{
    Departure{"power.transition-11", "605Ah above 2 stops at once and ends in switch on disabled (Table 158)",
              "605Ah = 6"},
    Departure{"power.transition-12", "605Ah above 2 stops at once and ends in switch on disabled (Table 158)",
              "quick stop active"},
    Departure{"power.transition-16", "605Ah above 2 stops at once and ends in switch on disabled (Table 158)",
              "quick stop active"},
    Departure{"power.option-605A", "3 to 32767 are taken, and stop at once (Table 158)", "605Ah"},
    Departure{"power.option-605D", "3 to 32767 are taken, and stop at once (Table 161)", "605Dh"},
    Departure{"pv.zero-speed", "bit 12 of profile velocity is following the command, not speed zero (Table 156)",
              "bit 12"},
    Departure{"homing.offset", "607Ch is travelled, and not in method 35: the present point is 0 (Chart 42, HM 2.35)",
              "6064h"},
    Departure{"fault.error-code",
              "the error register is as printed with each fault, without the generic bit (Table 18)", "1001h"},
};

}  // namespace

constinit const Product product{
    .name = "jmc_ec",
    .dialect = dialect,
    .rules = {.commands = commands, .connection = connection, .restart = restart, .by_model = by_model},
    .gain_guide = gain_guide,
    .fault_texts = fault_texts,
    .alarm_name = alarm_name,
    .object_texts = object_texts,
    .status_words = status_words,
    .mode_names = cia402::mode_names,
    .terminal_words = terminal_words,
    .departures = departures,
};

}  // namespace servodrome::catalogue::jmc_ec
