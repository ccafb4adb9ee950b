#include <array>

#include "catalogue/cia402/status_rows.hpp"
#include "catalogue/cia402/store.hpp"
#include "catalogue/ismc/fault_texts.hpp"
#include "catalogue/ismc/object_texts.hpp"
#include "catalogue/ismc/terminals.hpp"
#include "catalogue/list.hpp"

namespace servodrome::catalogue::ismc {
namespace {

// Halt clears the buffer of set-points (manual, ch. 4.3.6, 'Point to point stop').
constexpr Dialect dialect{.halt_drops_target = true};

// Manual, ch. 6, Table 5-1: stored, and in force after a restart.
constexpr auto connection = std::to_array<ObjectRange>({{0x2004}, {0x2401}});

// Application manual V1.6
constexpr std::array departures{
    Departure{"abort.value-range",
              "a homing method that it does not have is taken, and is fault 6289h when homing starts (ch. 5)", "6098h"},
    Departure{"power.transition-16", "transition 16 is not supported (Table 3-2)", "6041h = 0617h"},
};

}  // namespace

constinit const Product product{
    .name = "ismc",
    .dialect = dialect,
    .rules = {.connection = connection, .store = cia402::store},
    .fault_texts = fault_texts,
    .object_texts = object_texts,
    .status_words = cia402::status_words,
    .mode_names = cia402::mode_names,
    .terminal_words = terminal_words,
    .departures = departures,
};

}  // namespace servodrome::catalogue::ismc
