#pragma once

#include "catalogue.hpp"
#include "random.hpp"
#include "sequence.hpp"

namespace servodrome::motion {

// The sequence with this number of a run: a pure function of the seed, the number and the variants.
Sequence generate(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants);

}  // namespace servodrome::motion
