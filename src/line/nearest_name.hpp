#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace servodrome::line {

// The candidate that `name` was probably meant to be (edit distance of at most a third of its length, at least 1), or
// an empty view.
std::string_view nearest_name(std::string_view name, const std::vector<std::string_view>& candidates);

// "did you mean `x`?" if there is a near one, else "known here: a, b, c".
std::string suggestion(std::string_view name, const std::vector<std::string_view>& candidates);

}  // namespace servodrome::line
