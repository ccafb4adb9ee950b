#pragma once

#include <array>

#include "catalogue/gains.hpp"

namespace servodrome::catalogue::generic402 {

// Objects 2010h (src/products/generic402/README.md). Tuning does not change filters; their delay is part of the
// measurement.
using enum GainRole;
using enum GainBase;

inline constexpr auto gains = std::to_array<GainObject>({
    {velocity_kp, "velocity loop, proportional", {0x2010, 2}, 4, "uA s/rad", nameplate_torque, 1e-6, 4294967295.0},
    {velocity_ki, "velocity loop, integral", {0x2010, 3}, 4, "uA/rad", nameplate_torque, 1e-6, 4294967295.0},
    {position_kp, "position loop", {0x2010, 1}, 4, "0.01/s", plain, 0.01, 4294967295.0},
    {notch_frequency, "notch 1, frequency", {0x2010, 8}, 2, "Hz", plain, 1.0, 3000.0},
    {notch_width, "notch 1, width", {0x2010, 9}, 2, "Hz", plain, 1.0, 65535.0},
    {notch_depth, "notch 1, depth", {0x2010, 10}, 2, "0.1%", plain, 0.001, 1000.0},
});
inline constexpr TuningDialect tuning{.gains = gains,
                                      .notch = NotchAbility{.relative_width = 0.7, .depth = 0.15, .highest_hz = 1500.0},
                                      .zero_is_automatic = true};

// Objects 2010h to 2012h (src/products/generic402/README.md).
inline constexpr auto gain_guide = std::to_array<GainLine>({
    {{0x2010, 2}, "Gains", gain_effects::velocity_kp},
    {{0x2010, 3}, "Gains", gain_effects::velocity_ki},
    {{0x2010, 1}, "Gains", gain_effects::position_kp},
    {{0x2010, 4}, "Feed-forward", gain_effects::velocity_forward},
    {{0x2010, 5}, "Feed-forward", gain_effects::acceleration_forward},
    {{0x2010, 6}, "Filters", "less delay, more encoder noise; 0: off"},
    {{0x2010, 7}, "Filters", "less delay, more torque noise; 0: off"},
    {{0x2010, 8}, "Filters", gain_effects::notch},
    {{0x2010, 9}, "Filters", "the notch becomes wider and costs more phase"},
    {{0x2010, 10}, "Filters", "more of the torque remains at this frequency"},
    {{0x2010, 11}, "Filters", gain_effects::notch},
    {{0x2010, 12}, "Filters", "the notch becomes wider and costs more phase"},
    {{0x2010, 13}, "Filters", "more of the torque remains at this frequency"},
    {{0x2011, 2}, "Where a gain is 0", "the drive calculates its gains for a higher bandwidth"},
    {{0x2011, 1}, "Where a gain is 0", "bandwidth of the current loop; the other loops reach a fifth of it at most"},
    {{0x2012, 0}, "Where a gain is 0", "the drive calculates its gains for a higher inertia (ratio to the rotor's)"},
});

}  // namespace servodrome::catalogue::generic402
