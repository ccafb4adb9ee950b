#pragma once

#include <string>
#include <vector>

#include "scenario/excerpt.hpp"
#include "scenario/scenario.hpp"
#include "scenario/verdict.hpp"

namespace servodrome::scenario {

// The outcome of one scenario with one master.
struct TrialResult {
  // `error`: the scenario could not be run. `not_reached`: no rule acted, the master sent nothing, or the trial ended
  // before a standard expectation was watched; and no expectation failed, and the master did not end with an error.
  enum class Outcome : std::uint8_t { passed, failed, not_reached, error };

  std::string path;  // of the scenario file
  Scenario scenario;
  Outcome outcome = Outcome::error;
  std::string reason;  // of an error or a failure without a verdict; empty: see the verdicts
  std::vector<Verdict> verdicts;
  std::vector<RuleReport> rules;
  int exit_status = 0;
  bool was_ended = false;     // the trial ended the master, because its time was over
  bool uses_buses = false;    // the master is a program that commands its drives over their buses
  bool was_silent = false;    // such a master sent nothing, although it could
  bool interrupted = false;   // the user ended the trial: it has no outcome
  Time master_end{};          // line time at which the master ended
  Time duration{};            // line time
  std::string master_output;  // its last lines
  std::string picture;        // SVG of the shafts and states; may be empty
  // For each bus: the traffic around the failures and the first acts of the rules.
  std::vector<BusExcerpt> traffic;
  std::vector<std::string> captures;  // files with the whole traffic
};

std::string_view word_of(TrialResult::Outcome outcome);

// Sets `outcome` and `reason` from verdicts, rules and exit status. Adds the verdict on whether the master has ended by
// itself, and the waived expectations.
void judge(TrialResult& result);

}  // namespace servodrome::scenario
