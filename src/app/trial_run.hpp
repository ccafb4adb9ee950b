#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scenario/trial_result.hpp"

namespace servodrome::app {

// Runs a master against a line under a scenario, in real time.
struct TrialRun {
  std::vector<std::string> master;  // the command; {link}, {host}, {port}, {api} and {scenario} are replaced
  std::filesystem::path folder;     // for the files of this run; must exist
  links::Time after = std::chrono::seconds(3);  // the line runs on so long after the master has ended
};

// Returns what became of it; does not throw for a scenario that cannot be run.
scenario::TrialResult run_trial(const TrialRun& run, const std::string& scenario_path);

}  // namespace servodrome::app
