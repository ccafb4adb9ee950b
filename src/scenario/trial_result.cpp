#include "scenario/trial_result.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>

namespace servodrome::scenario {

std::string_view word_of(TrialResult::Outcome outcome) {
  constexpr std::array<std::string_view, 4> words{"passed", "failed", "not reached", "error"};
  return words[static_cast<std::size_t>(outcome)];
}

void judge(TrialResult& result) {
  using Result = TrialResult::Outcome;
  for (const RuleReport& rule : result.rules) {
    if (rule.error.empty()) continue;
    result.outcome = Result::error;
    result.reason = fmt::format("{}: {}", rule.name, rule.error);
    return;
  }
  const bool acted =
      std::any_of(result.rules.begin(), result.rules.end(), [](const auto& rule) { return rule.acts > 0; });
  if (!acted && !result.rules.empty()) {
    result.outcome = Result::not_reached;
    result.reason = "no rule has acted: the master did not do what the scenario waits for";
    return;
  }
  const bool failed = std::any_of(result.verdicts.begin(), result.verdicts.end(),
                                  [](const Verdict& verdict) { return verdict.outcome == Outcome::failed; });
  const bool succeeded = !result.was_ended && result.exit_status == 0;
  result.outcome = failed ? Result::failed : Result::passed;
  if (result.scenario.master == MasterStatus::success && !succeeded) {
    result.outcome = Result::failed;
    result.reason = result.was_ended ? "the master did not end in time"
                                     : fmt::format("the master ended with status {}", result.exit_status);
  } else if (result.scenario.master == MasterStatus::failure && succeeded) {
    result.outcome = Result::failed;
    result.reason = "the master ended with status 0, as if nothing had happened";
  }
}

std::vector<Expectation> standard_expectations(const std::vector<std::string>& axes) {
  std::vector<Expectation> expectations;
  for (const std::string& axis : axes) {
    Expectation rest;
    rest.name = fmt::format("{} rests after the master has ended", axis);
    rest.axis = axis;
    rest.kind = Expectation::Kind::always;
    rest.when.ended = std::chrono::seconds(2);
    rest.what.at_rest = true;
    expectations.push_back(std::move(rest));
  }
  return expectations;
}

}  // namespace servodrome::scenario
