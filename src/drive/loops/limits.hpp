#pragma once

#include <algorithm>

// Limits that the cascade's tick and its configuration share.
namespace servodrome::drive {

// A braking current may use up to this fraction of the DC link's voltage.
inline constexpr float braking_voltage_share = 0.95F;

// Lowers `value` to `high` after raising it to `low`, so `high` has priority if the limits cross.
inline float clip(float value, float low, float high) { return std::min(std::max(value, low), high); }

}  // namespace servodrome::drive
