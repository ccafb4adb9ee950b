#pragma once

#include "axis/axis_rig.hpp"

// Motions of the reference drive that take less than a second.
namespace servodrome::master::test::quick_motions {

inline constexpr std::int32_t revolution = 131072;
inline constexpr MotionProfile quick{10 * revolution, 100 * revolution, 100 * revolution};
inline constexpr HomingRequest to_index{34, 2 * revolution, revolution, 100 * revolution, {}};

}  // namespace servodrome::master::test::quick_motions
