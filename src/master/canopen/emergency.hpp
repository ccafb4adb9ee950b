#pragma once

#include <optional>

#include "canopen/frame.hpp"
#include "master/emergency.hpp"

namespace servodrome::master {

// The EMCY in a frame with one of the default COB-IDs 081h..0FFh (CiA 301 7.2.7); nullopt for other frames.
std::optional<Emergency> parse_emergency(const canopen::Frame& frame);

}  // namespace servodrome::master
