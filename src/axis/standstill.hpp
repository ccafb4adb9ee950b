#pragma once

#include <cstdint>

#include "links/time.hpp"

// A shaft stands if its position changes by at most still_counts for still_time.
namespace servodrome::master {

// Encoder noise and the control loop move a standing shaft a little.
inline constexpr std::int64_t still_counts = 10;
inline constexpr links::Time still_time = std::chrono::milliseconds(50);

}  // namespace servodrome::master
