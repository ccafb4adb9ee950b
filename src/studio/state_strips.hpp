#pragma once

#include <string>

#include "line/line.hpp"
#include "scenario/shaft_log.hpp"

namespace servodrome::studio {

// An SVG with a strip for each axis: its states in words over time, below the picture of scope::svg_of and aligned
// with it.
std::string state_strips_of(const line::Line& line, const scenario::ShaftLog& log);

}  // namespace servodrome::studio
