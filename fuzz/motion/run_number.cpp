#include "run_number.hpp"

#include <algorithm>

namespace servodrome::motion {

bool recovers(std::uint64_t number, Tree tree) { return number % std::max<std::uint64_t>(16, tree.leaves()) == 5; }
bool runs_twice(std::uint64_t number, Tree tree) { return number % (16 * tree.leaves()) == 9; }

Outcome run_number(const Options& options, std::uint64_t number, const Sequence& sequence, RunOptions run_options) {
  run_options.recover = recovers(number, options.tree);
  return run_checked(sequence, run_options, runs_twice(number, options.tree));
}

std::string product_of(const Sequence& sequence, const Finding& finding) { return sequence.axes[finding.axis].product; }

}  // namespace servodrome::motion
