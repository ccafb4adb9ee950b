#pragma once

#include <cstdint>

namespace servodrome::links {

// On which side of a serial line something was sent.
enum class SerialSender : std::uint8_t { unknown, master, drive };

}  // namespace servodrome::links
