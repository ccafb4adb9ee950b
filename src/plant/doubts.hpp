#pragma once

#include <string>
#include <vector>

#include "plant/parameters.hpp"

namespace servodrome::plant {

// Warnings for parameters that validate() accepts: effects that are too fast for the tick, and values that do not occur
// together in a real machine. The messages have the form of those of validate().
std::vector<std::string> doubts(const Parameters& parameters);

}  // namespace servodrome::plant
