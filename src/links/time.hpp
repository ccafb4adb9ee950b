#pragma once

#include <chrono>

namespace servodrome::links {

// The time of a line: nanoseconds since the line started, in real or virtual time.
using Time = std::chrono::nanoseconds;

inline constexpr Time never = Time::max();

inline double to_seconds(Time time) { return std::chrono::duration<double>(time).count(); }

// Cuts off what is less than a nanosecond. The number must fit into a Time (292 years).
inline Time from_seconds(double seconds) {
  return std::chrono::duration_cast<Time>(std::chrono::duration<double>(seconds));
}

// The clocks of this computer, for real buses. steady_now() counts from an arbitrary start and never goes back;
// wall_now() counts from 1970 (Unix time).
inline Time steady_now() { return std::chrono::steady_clock::now().time_since_epoch(); }
inline Time wall_now() { return std::chrono::system_clock::now().time_since_epoch(); }

}  // namespace servodrome::links
