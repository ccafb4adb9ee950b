#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scenario/trial_result.hpp"

namespace servodrome::app {

// Runs a master against a line under a scenario, in real time.
struct TrialRun {
  // The command; {link}, {products}, {host}, {port}, {api}, {scenario} and {job} are replaced.
  std::vector<std::string> master;
  std::vector<std::string> links;               // values of --bus, which replace links of the line; {job} is replaced
  unsigned job = 0;                             // number of this run among those at the same time
  std::filesystem::path folder;                 // for the files of this run; it is made if it does not exist
  std::filesystem::path keep;                   // for captures of all buses; empty: none are kept
  links::Time after = std::chrono::seconds(3);  // time for which the line runs on after the master has ended
};

// The beginning of the names of a scenario's captures: "canopen-boot-up-late", of its folder and its file.
std::string capture_name(const std::string& scenario_path);
// Loads the scenario and tries it on its line, which does not run. If the scenario has an error, the result has a
// reason.
scenario::TrialResult check_trial(const std::string& scenario_path);
// Returns the outcome; does not throw for a scenario that cannot be run.
scenario::TrialResult run_trial(const TrialRun& run, const std::string& scenario_path);

}  // namespace servodrome::app
