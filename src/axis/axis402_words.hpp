#pragma once

#include "drive/power/power_state.hpp"
#include "links/time.hpp"

// Controlwords of an enabled axis (CiA 402-2 table 24 and the modes' chapters).
namespace servodrome::master {

namespace controlword = drive::controlword;
namespace statusword_bit = drive::statusword;

inline constexpr std::uint16_t enabled = 0x000F;
inline constexpr std::uint16_t change_immediately = controlword::mode_bit_5;

// A drive clears "target reached" some cycles after it accepts a set-point; until then the bit may belong to the
// previous set-point. This is the time to wait before the bit counts.
inline constexpr links::Time settling = std::chrono::milliseconds(20);

}  // namespace servodrome::master
