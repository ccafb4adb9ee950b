#pragma once

#include <string>

#include "fit/fit.hpp"

namespace servodrome::fit {

// A table of all parameters, with what is missing, and the remarks.
std::string table_of(const Result& result);

// The keys of a line file (docs/line-file.md): [axis.motor], [axis.load] and [axis.encoder], with what was found and
// what `motor` had of it, to be put behind an [[axis]]. What lies outside of a key's range by its confidence interval
// alone, a friction below 0 say, is put on its edge.
std::string toml_of(const Result& result, const Motor& motor);

}  // namespace servodrome::fit
