#pragma once

#include <string>
#include <vector>

#include "plant/parameters.hpp"

namespace servodrome::plant {

// What a plant of accepted parameters cannot show, and figures that no machine has together. Messages as those of
// validate(), with which it runs all the same.
std::vector<std::string> doubts(const Parameters& parameters);

}  // namespace servodrome::plant
