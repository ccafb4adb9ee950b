#pragma once

#include <string>
#include <vector>

#include "line/config.hpp"

namespace servodrome::app {

// Replaces the links of buses by the values of `--bus NAME=LINK`, or `--bus LINK` if the line has only one bus of the
// link's kind. A bus that occurs several times gets several links. Throws Failure for a value that does not fit the
// line.
void override_links(line::LineSettings& settings, const std::vector<std::string>& options);

}  // namespace servodrome::app
