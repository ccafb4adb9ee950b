#pragma once

#include <chrono>

namespace servodrome::links {

// Time of a line: nanoseconds since the line started, on whichever clock drives it (real or virtual).
using Time = std::chrono::nanoseconds;

inline constexpr Time never = Time::max();

}  // namespace servodrome::links
