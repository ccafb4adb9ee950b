#pragma once

#include <string>

#include "line/config.hpp"

namespace servodrome::app {

// The line of a file, or the built-in one for an empty name. Throws Failure with all that is wrong with it.
line::LineSettings load_line(const std::string& file);

}  // namespace servodrome::app
