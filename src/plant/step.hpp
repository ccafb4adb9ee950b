#pragma once

#include <cstdint>
#include <numbers>

#include "drive/hardware.hpp"

// What several formulas of the plant use.
namespace servodrome::plant {

inline constexpr double h = drive::tick_seconds;  // seconds of one step
inline constexpr double tick_us = h * 1.0e6;
inline constexpr double two_pi = 2.0 * std::numbers::pi;

constexpr int sign_of(double value) { return (value > 0.0) - (value < 0.0); }
constexpr std::uint32_t bit(drive::HardwareFault fault) { return static_cast<std::uint32_t>(fault); }

}  // namespace servodrome::plant
