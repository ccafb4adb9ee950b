#pragma once

#include <string>

#include "fit/fit.hpp"

namespace servodrome::fit {

// A table of all parameters, the missing ones with reason and remedy, and the remarks.
std::string table_of(const Result& result);

// The keys of a line file (docs/line-file.md) to be put behind an [[axis]]: [axis.motor], [axis.load] and
// [axis.encoder], with the values found and those given in `motor`. A value below the key's range, such as a negative
// friction, is replaced by the range's limit. The remarks come first, as comments.
std::string toml_of(const Result& result, const Motor& motor);

}  // namespace servodrome::fit
