#pragma once

#include <numbers>

#include "drive/hardware.hpp"

// The loops compute in float.
namespace servodrome::drive {

inline constexpr float pi = std::numbers::pi_v<float>;
inline constexpr float tick_s = static_cast<float>(tick_seconds);

}  // namespace servodrome::drive
