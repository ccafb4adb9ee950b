#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace servodrome::links {

// The candidate that is closest to a misspelt `name`, or an empty view if none is close: the edit distance may be at
// most a third of the name's length, but at least 1.
std::string_view nearest_name(std::string_view name, const std::vector<std::string_view>& candidates);

// Returns "did you mean `x`?" if there is a close name, otherwise "known here: a, b, c".
std::string suggestion(std::string_view name, const std::vector<std::string_view>& candidates);

}  // namespace servodrome::links
