#include "scenario/trial_result.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <utility>

#include "links/time.hpp"
#include "scenario/standard.hpp"

namespace servodrome::scenario {
namespace {

// Returns the signal that has killed a crashed program, from its exit status (128 + signal, as in a shell); nullptr:
// the status is that of no crash. The signals that ask a program to end, such as SIGTERM, are no crash: a master may
// end itself with them.
const char* crash_of(int exit_status) {
  constexpr std::array<std::pair<int, const char*>, 7> crashes{
      {{4, "SIGILL"}, {5, "SIGTRAP"}, {6, "SIGABRT"}, {7, "SIGBUS"}, {8, "SIGFPE"}, {9, "SIGKILL"}, {11, "SIGSEGV"}}};
  for (const auto& [signal, name] : crashes) {
    if (exit_status == 128 + signal) return name;
  }
  return nullptr;
}

}  // namespace

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
  const bool ends = !result.scenario.waived.contains(ends_by_itself);
  if (ends) {
    Verdict& verdict = result.verdicts.emplace_back();
    verdict.name = standards().back().name;
    verdict.outcome = result.was_ended ? Outcome::failed : Outcome::passed;
    verdict.at = result.master_end;
    if (result.was_ended) {
      verdict.found = fmt::format("the trial ended it after {} s", links::to_seconds(result.scenario.duration));
    } else if (const char* signal = crash_of(result.exit_status)) {
      verdict.outcome = Outcome::failed;
      verdict.found = fmt::format("{} ended it (status {})", signal, result.exit_status);
    }
  }
  const bool failed = std::any_of(result.verdicts.begin(), result.verdicts.end(),
                                  [](const Verdict& verdict) { return verdict.outcome == Outcome::failed; });
  const auto unwatched = std::find_if(result.verdicts.begin(), result.verdicts.end(), [](const Verdict& verdict) {
    return verdict.outcome == Outcome::not_reached && is_standard(verdict.name);
  });
  const bool is_watched = unwatched == result.verdicts.end();
  const std::string missing = is_watched ? "" : unwatched->name;
  for (Verdict& waived : waived_verdicts(result.scenario)) result.verdicts.push_back(std::move(waived));
  const bool acted =
      std::any_of(result.rules.begin(), result.rules.end(), [](const auto& rule) { return rule.acts > 0; });
  const bool succeeded = !result.was_ended && result.exit_status == 0;
  if (!failed && (result.was_silent || (!acted && !result.rules.empty()))) {
    const bool broke_down = !result.was_ended && !succeeded;
    result.outcome = broke_down ? Result::failed : Result::not_reached;
    if (broke_down) {
      result.reason = fmt::format("the master ended with status {} before {}", result.exit_status,
                                  result.was_silent ? "it sent anything" : "any rule acted");
    } else {
      result.reason = result.was_silent ? "the master sent nothing on the bus"
                                        : "no rule has acted: nothing happened that a rule waits for";
    }
    return;
  }
  result.outcome = failed ? Result::failed : is_watched ? Result::passed : Result::not_reached;
  if (result.outcome == Result::not_reached) {
    result.reason =
        fmt::format("\"{}\" was not watched: the line has to run on longer after the end of the master", missing);
  }
  if (result.scenario.master == MasterStatus::success && !succeeded) {
    result.outcome = Result::failed;
    result.reason = result.was_ended ? "the master did not end in time"
                                     : fmt::format("the master ended with status {}", result.exit_status);
  } else if (result.scenario.master == MasterStatus::failure && succeeded) {
    result.outcome = Result::failed;
    result.reason = "the master ended with status 0, as if nothing had happened";
  }
}

}  // namespace servodrome::scenario
