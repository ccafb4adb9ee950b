#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scenario/trial_result.hpp"

// Reports of trials, made from the JSON of a trial. Therefore trials of the program and trials in a caller's process
// have the same reports.
namespace servodrome::scenario {

using TrialJson = nlohmann::ordered_json;

// Outcome, expectations, rules and the master's output; for a failed trial also the traffic.
TrialJson json_of(const TrialResult& result);

// A JUnit report of such objects: a test suite for each folder, a test case for each scenario. "not reached" counts as
// skipped.
std::string junit_of(const TrialJson& trials, const std::string& master);

// A page with a table of all trials, and then their sections.
std::string html_of(const TrialJson& trials, const std::vector<std::string>& sections, const std::string& master);
// The details of a trial: texts, verdicts, motion and traffic.
std::string html_section_of(const TrialResult& result);

}  // namespace servodrome::scenario
