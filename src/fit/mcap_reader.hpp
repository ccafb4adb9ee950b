#pragma once

#include "fit/table.hpp"

namespace servodrome::fit {

inline constexpr std::string_view mcap_magic("\x89MCAP0\r\n", 8);

// MCAP 0 (mcap.dev/spec) as scope and bench API write it: JSON messages, chunks that are not compressed, a clock for
// each topic. Throws Error for what is damaged or otherwise made.
Table read_mcap(std::string_view bytes, const std::string& source);

}  // namespace servodrome::fit
