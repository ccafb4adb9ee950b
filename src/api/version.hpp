#pragma once

#include <string>

namespace servodrome::api {

// The version of this build: a number, and for a build between two releases the commit: "0.1.0", "0.1.0+5.g1a2b3c4d5".
const char* version() noexcept;

// A random name of this run of the program: the numbers of jobs and recordings count from 1 in each run.
const std::string& run_name();

}  // namespace servodrome::api
