#include "host/conform/departures.hpp"

#include <array>

namespace servodrome::host::conform {
namespace {

// Lines are those of the manuals' texts, as in the products' READMEs.
constexpr std::array rows{
    // ISMC application manual V1.6
    Departure{"ismc", "abort.value-range",
              "a homing method that it does not have is taken, and is fault 6289h when homing starts (L2800)", "6098h"},
    Departure{"ismc", "power.transition-16", "transition 16 is not supported (L809)", "6041h = 0617h"},
    // ProNet CANopen user's manual V1.04
    Departure{"pronet", "identity.supported-modes", "there is no 6502h (object list L2350-2740)", "6502h"},
    Departure{"pronet", "power.remote", "bits 8 and 9 of the statusword are not used (L1126-1217)", "bit 9"},
    // iSMK manual
    Departure{"ismk", "power.transition-11", "the statusword of quick stop active ends in 50h (L1052)", "50h"},
    Departure{"ismk", "power.transition-12", "the statusword of quick stop active ends in 50h (L1052)", "50h"},
    Departure{"ismk", "power.transition-16", "the statusword of quick stop active ends in 50h (L1052)", "50h"},
};

}  // namespace

std::span<const Departure> all_departures() { return rows; }

}  // namespace servodrome::host::conform
