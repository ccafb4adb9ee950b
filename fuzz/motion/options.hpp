#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "generate.hpp"

// The command line of motion_fuzz.
namespace servodrome::motion {

struct Options {
  std::uint64_t sequences = 10000;
  double seconds = 0;
  std::uint64_t seed = 1;
  std::uint64_t first = 0;
  Tree tree;
  std::string product;
  std::string model;
  int jobs = 1;
  std::optional<std::uint64_t> one;
  bool print = false;
  bool story = false;
  std::int64_t each_ms = 10;
  std::vector<std::string> replays;
  std::string only;
  std::set<std::string> without;
  std::set<std::string> known;  // "invariant product"
  std::string keep;
  bool until_found = false;
  bool shrinks = true;
  bool coverage = false;
  bool json = false;
};

// Prints the message and ends the program with status 2.
[[noreturn]] void wrong_usage(const std::string& what);

// Ends the program at --help, at --invariants and at a wrong command line.
Options parse_options(int argc, char** argv);

}  // namespace servodrome::motion
