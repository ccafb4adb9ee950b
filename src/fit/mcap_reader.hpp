#pragma once

#include "fit/table.hpp"

namespace servodrome::fit {

inline constexpr std::string_view mcap_magic("\x89MCAP0\r\n", 8);

// Reads MCAP 0 (mcap.dev/spec) as written by scope and bench API: JSON messages, uncompressed chunks, one clock for
// each topic. Throws Error for a damaged file and for other forms of MCAP.
Table read_mcap(std::string_view bytes, const std::string& source);

}  // namespace servodrome::fit
