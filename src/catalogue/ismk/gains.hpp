#pragma once

#include <array>
#include <numbers>

#include "catalogue/gains.hpp"

namespace servodrome::catalogue::ismk {

using enum GainRole;
using enum GainBase;

// iSMK manual, ch. 6, as interpreted in src/products/ismk/gains.hpp: kvp is a current in DEC divided by a velocity
// in DEC, over 2^18; Kvi/32 is accumulated at 4 kHz.
inline constexpr double integral_hz = 4000.0;
inline constexpr auto gains = std::to_array<GainObject>({
    {velocity_kp, "Kvp[0]", {0x60F9, 1}, 2, "DEC", ismk_current, 1.0, 32767.0},
    {velocity_ki_coarse, "Kvi[0]", {0x60F9, 2}, 2, "DEC", ismk_current, integral_hz, 16384.0},
    {velocity_ki, "Kvi/32", {0x60F9, 7}, 2, "DEC", ismk_current, integral_hz / 32.0, 32767.0},
    {position_kp, "Kpp[0]", {0x60FB, 1}, 2, "0.01 Hz", plain, 2.0 * std::numbers::pi * 0.01, 32700.0},
    {notch_frequency, "notch filter, frequency", {0x60F9, 3}, 2, "Hz", plain, 1.0, 2000.0},
    {notch_switch, "notch filter, control", {0x60F9, 4}, 1, "code", plain, 1.0, 1.0},
});
inline constexpr TuningDialect tuning{.velocity_mode = -3,
                                      .position = {0x6063, 0},
                                      .torque = {0x6078, 0},
                                      .full_torque = 2048.0,
                                      .full_torque_text = "peak current",
                                      .gains = gains,
                                      .notch = NotchAbility{.relative_width = 0.5, .depth = 0.05, .highest_hz = 1000.0},
                                      .tunes_itself = true};

// iSMK manual, ch. 6.
inline constexpr auto gain_guide = std::to_array<GainLine>({
    {{0x60F9, 1}, "Gain set 0", gain_effects::velocity_kp},
    {{0x60F9, 2}, "Gain set 0", gain_effects::velocity_ki},
    {{0x60F9, 7}, "Gain set 0", "as Kvi[0], in steps of a 32nd"},
    {{0x60FB, 1}, "Gain set 0", gain_effects::position_kp},
    {{0x2340, 4}, "Gain set 1", gain_effects::velocity_kp},
    {{0x2340, 5}, "Gain set 1", gain_effects::velocity_ki},
    {{0x2340, 6}, "Gain set 1", gain_effects::position_kp},
    {{0x2340, 7}, "Gain set 2", gain_effects::velocity_kp},
    {{0x2340, 8}, "Gain set 2", gain_effects::velocity_ki},
    {{0x2340, 9}, "Gain set 2", gain_effects::position_kp},
    {{0x2340, 10}, "Gain set 3", gain_effects::velocity_kp},
    {{0x2340, 11}, "Gain set 3", gain_effects::velocity_ki},
    {{0x2340, 12}, "Gain set 3", gain_effects::position_kp},
    {{0x60F9, 9}, "Choice of the set", "1: set 1 at target reached or zero speed, else set 0; inputs have priority"},
    {{0x60F9, 40}, "Choice of the set", "the active set"},
    {{0x60FB, 2}, "Feed-forward", gain_effects::velocity_forward},
    {{0x60FB, 3}, "Feed-forward", "32767: off; a smaller value adds more torque during acceleration"},
    {{0x60F9, 5}, "Filters", "less delay, more noise of the speed"},
    {{0x60F9, 6}, "Filters", "how the speed is calculated from the encoder's positions"},
    {{0x60F9, 21}, "Filters", "output filter: less noise in the current, more delay"},
    {{0x60FB, 5}, "Filters", "smoothes the position command over a longer time"},
    {{0x60F9, 3}, "Filters", gain_effects::notch},
    {{0x60F9, 4}, "Filters", "bits 0 and 1: active notch filters"},
    {{0x250B, 1}, "Filters", gain_effects::notch},
    {{0x250B, 2}, "Filters", gain_effects::notch},
    {{0x250B, 3}, "Filters", gain_effects::notch},
    {{0x2FF0, 10}, "Tuning by the drive", "the bandwidth that results from Kvp[0] and the identified inertia"},
    {{0x2340, 16}, "Tuning by the drive", "what the drive adjusts automatically"},
});

}  // namespace servodrome::catalogue::ismk
