#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "scenario/scenario.hpp"
#include "scenario/verdict.hpp"

// The expectations of every trial, in addition to those of its scenario. They apply to every master and every error. A
// scenario can switch one off by its word, with a reason: [waive] ends = "the program waits for the operator".
namespace servodrome::scenario {

struct Standard {
  std::string_view word;  // in the file
  std::string_view name;  // in reports; after the axis' name if `of_axis`
  bool of_axis;
  void (*fill)(Expectation& expectation);  // nullptr: judge() decides it
};

const std::array<Standard, 5>& standards();

inline constexpr std::string_view ends_by_itself = "ends";

// True for the name of a verdict on a standard expectation.
bool is_standard(std::string_view name);

// The standard expectations that `scenario` does not waive, for each axis.
std::vector<Expectation> standard_expectations(const Scenario& scenario, const std::vector<std::string>& axes);
// The waived expectations, as verdicts with the outcome `not_reached` and the reason.
std::vector<Verdict> waived_verdicts(const Scenario& scenario);

}  // namespace servodrome::scenario
