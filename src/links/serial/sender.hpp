#pragma once

#include <cstdint>

namespace servodrome::links {

// The side of a serial line that has sent something.
enum class SerialSender : std::uint8_t { unknown, master, drive };

}  // namespace servodrome::links
