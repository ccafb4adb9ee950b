#pragma once

#include <cstdint>
#include <string>

#include "machine.hpp"
#include "options.hpp"

// How motion_fuzz runs a sequence with a number.
namespace servodrome::motion {

// One sequence in 16 must get back to Operation enabled at its end, and one in 16 is run twice. With trees both are
// rarer, because either takes as long as many leaves.
bool recovers(std::uint64_t number, Tree tree);
bool runs_twice(std::uint64_t number, Tree tree);

Outcome run_number(const Options& options, std::uint64_t number, const Sequence& sequence, RunOptions run_options);

// The product of the axis with the finding.
std::string product_of(const Sequence& sequence, const Finding& finding);

}  // namespace servodrome::motion
