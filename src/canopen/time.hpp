#pragma once

#include <chrono>

namespace servodrome::canopen {

// A point in time on the caller's monotonic clock, or a duration. The stack never reads a clock: the caller passes the
// time.
using Time = std::chrono::nanoseconds;

inline constexpr Time never = Time::max();

}  // namespace servodrome::canopen
