#pragma once

#include <chrono>

namespace servodrome::links {

// The time of a line: nanoseconds since the line started, in real or virtual time.
using Time = std::chrono::nanoseconds;

inline constexpr Time never = Time::max();

}  // namespace servodrome::links
