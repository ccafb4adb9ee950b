#pragma once

#include <string>

#include "host/conform/run.hpp"

namespace servodrome::host::conform {

// An outcome for people: a line, and what was not met below it; `all`: what was met as well.
std::string text_of(const Outcome& outcome, bool all = false);
// "61 checks: 57 passed, 1 failed, 2 departures, 1 skipped"
std::string summary_of(const Report& report);
// For continuous integration: a test suite for each group, a test case for each check. Departures are passed test cases
// whose output says what the manual says.
std::string junit_of(const Report& report, const std::string& drive);

}  // namespace servodrome::host::conform
