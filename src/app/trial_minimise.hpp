#pragma once

#include "app/trial_run.hpp"

namespace servodrome::app {

struct Minimised {
  std::string path;  // of the smallest file; empty: nothing could be left out
  std::string failure;
  unsigned runs = 0;
};

// Leaves out of a failing scenario what is not needed for its failure: runs smaller and smaller ones while the same
// expectation fails, `jobs` at once, at most `most_runs`. Writes the smallest one beside the file, under a new name,
// and prints its progress if `talks`. Throws Failure if the scenario does not fail.
Minimised minimise(const TrialRun& run, const std::string& path, unsigned most_runs, unsigned jobs, bool talks);

}  // namespace servodrome::app
