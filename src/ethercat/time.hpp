#pragma once

#include <chrono>

namespace servodrome::ethercat {

// A point on the caller's monotonic clock, or a span of it. The stack never asks for the time; it is told.
using Time = std::chrono::nanoseconds;

inline constexpr Time never = Time::max();

}  // namespace servodrome::ethercat
