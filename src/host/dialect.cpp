#include "host/dialect.hpp"

#include <algorithm>
#include <array>

namespace servodrome::host {
namespace {

constexpr Dialect cia402{};

// Bit 15 attained, bit 12 error, bit 10 stays 0 (iSMK manual L1148, L2406); units L3458-3467; sub 1 of 607Dh is the
// positive limit.
constexpr Dialect ismk(std::string_view product) {
  return {.product = product,
          .homing_signals = {.attained = 1U << 15, .error = 1U << 12, .target_reached = false},
          .units = AxisUnits{65536.0, 60.0 * 512.0 * 65536.0 / 1875.0, 65536.0 * 65536.0 / 4'000'000.0},
          .cautious_homing_method = 33,
          .software_limits = {.lowest = 2, .highest = 1}};
}

constexpr std::array dialects{
    // Halt empties the buffer of set-points (ISMC manual L1523-1530).
    Dialect{.product = "ismc", .halt_drops_target = true},
    // 0.1 rpm and 0.1 rpm/s (ProNet manual L750-762). The encoder cannot be asked for: increments of the 17-bit one.
    // Methods that look for an index are not for serial encoders (L1365).
    Dialect{.product = "pronet",
            .units = AxisUnits{131072.0, 600.0, 600.0},
            .has_old_factors = true,
            .cautious_homing_method = 35},
    ismk("ismk"),
    ismk("ismk-ea"),
    // Methods 0 to 35 (JMC manual L2858-2860).
    Dialect{.product = "jmc_ec", .cautious_homing_method = 35},
};

}  // namespace

const Dialect& dialect_of(std::string_view product) {
  const auto* const found = std::find_if(dialects.begin(), dialects.end(),
                                         [product](const Dialect& dialect) { return dialect.product == product; });
  return found != dialects.end() ? *found : cia402;
}

}  // namespace servodrome::host
