#pragma once

#include "app/trial_run.hpp"

namespace servodrome::app {

struct Minimised {
  std::string path;  // of the smallest file; empty: nothing could be removed
  std::string failure;
  unsigned runs = 0;
};

// Removes from a failing scenario what its failure does not need: runs smaller and smaller scenarios while the same
// expectation fails, `jobs` at the same time, at most `most_runs`. Writes the smallest one beside the file, under a new
// name, and prints its progress if `talks`. Throws Failure if the scenario does not fail.
Minimised minimise(const TrialRun& run, const std::string& path, unsigned most_runs, unsigned jobs, bool talks);

}  // namespace servodrome::app
