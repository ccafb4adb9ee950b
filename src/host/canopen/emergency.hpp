#pragma once

#include <optional>

#include "canopen/frame.hpp"
#include "host/emergency.hpp"

namespace servodrome::host {

// The EMCY in a frame of the default COB-IDs 081h..0FFh, or nothing (CiA 301 7.2.7).
std::optional<Emergency> parse_emergency(const canopen::Frame& frame);

}  // namespace servodrome::host
