#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "scenario/scenario.hpp"
#include "scenario/verdict.hpp"

// The expectations that every trial has in addition to those of its scenario: what every decent master does whatever
// breaks. A scenario leaves one out by its word, with a reason: [waive] ends = "the program waits for the operator".
namespace servodrome::scenario {

struct Standard {
  std::string_view word;  // in the file
  std::string_view name;  // in reports; for each axis behind the axis' name if `of_axis`
  bool of_axis;
  void (*fill)(Expectation& expectation);  // nullptr: judge() decides it
};

const std::array<Standard, 5>& standards();

inline constexpr std::string_view ends_by_itself = "ends";

// Those that `scenario` does not waive, for each axis.
std::vector<Expectation> standard_expectations(const Scenario& scenario, const std::vector<std::string>& axes);
// The others, as verdicts that are not reached and say why.
std::vector<Verdict> waived_verdicts(const Scenario& scenario);

}  // namespace servodrome::scenario
