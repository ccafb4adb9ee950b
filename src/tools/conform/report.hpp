#pragma once

#include <string>

#include "tools/conform/run.hpp"

namespace servodrome::master::conform {

// An outcome as text: one line, and below it the observations that were not met; with `all` the others too.
std::string text_of(const Outcome& outcome, bool all = false);
// For example "61 checks: 57 passed, 1 failed, 2 departures, 1 skipped".
std::string summary_of(const Report& report);
// A JUnit report for continuous integration: a test suite for each group, a test case for each check. Departures count
// as passed; their output contains the manual's statement.
std::string junit_of(const Report& report, const std::string& drive);

}  // namespace servodrome::master::conform
