#include "scenario/standard.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace servodrome::scenario {
namespace {

constexpr unsigned most_fault_resets = 5;  // in a second
constexpr unsigned most_repeats = 20;      // of an SDO request without an answer, in a second

}  // namespace

const std::array<Standard, 5>& standards() {
  static constexpr std::array<Standard, 5> table{{
      {"rests", "rests after the master has ended", true,
       [](Expectation& expectation) {
         expectation.kind = Expectation::Kind::always;
         expectation.when.ended = std::chrono::seconds(2);
         expectation.what.at_rest = true;
       }},
      {"fault_resets", "gets at most 5 fault resets in a second", true,
       [](Expectation& expectation) {
         expectation.kind = Expectation::Kind::never;
         expectation.what.fault_resets_above = most_fault_resets;
       }},
      {"set_point", "gets its first cyclic set-point within reach of one cycle", true,
       [](Expectation& expectation) {
         expectation.kind = Expectation::Kind::never;
         expectation.what.set_point_jumped = true;
       }},
      {"repeats", "gets at most 20 repeated SDO requests in a second", true,
       [](Expectation& expectation) {
         expectation.kind = Expectation::Kind::never;
         expectation.what.repeats_above = most_repeats;
       }},
      {ends_by_itself, "the master ends by itself", false, nullptr},
  }};
  return table;
}

bool is_standard(std::string_view name) {
  return std::any_of(standards().begin(), standards().end(),
                     [name](const Standard& standard) { return name.ends_with(standard.name); });
}

std::vector<Expectation> standard_expectations(const Scenario& scenario, const std::vector<std::string>& axes) {
  std::vector<Expectation> expectations;
  for (const Standard& standard : standards()) {
    if (standard.fill == nullptr || scenario.waived.contains(standard.word)) continue;
    for (const std::string& axis : axes) {
      Expectation& expectation = expectations.emplace_back();
      expectation.name = fmt::format("{} {}", axis, standard.name);
      expectation.axis = axis;
      standard.fill(expectation);
    }
  }
  return expectations;
}

std::vector<Verdict> waived_verdicts(const Scenario& scenario) {
  std::vector<Verdict> verdicts;
  for (const Standard& standard : standards()) {
    const auto reason = scenario.waived.find(standard.word);
    if (reason == scenario.waived.end()) continue;
    Verdict& verdict = verdicts.emplace_back();
    verdict.name = standard.name;
    verdict.found = "waived: " + reason->second;
  }
  return verdicts;
}

}  // namespace servodrome::scenario
