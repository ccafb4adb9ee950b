#pragma once

#include <csignal>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "coverage.hpp"
#include "options.hpp"

// Runs the sequences of a seed in several processes.
namespace servodrome::motion {

struct Found {
  std::uint64_t number = 0;  // of the first such sequence
  std::uint64_t count = 0;
  std::string text;
};
using Groups = std::map<std::pair<std::string, std::string>, Found>;  // by invariant and product

struct Result {
  Groups groups;
  std::map<std::string, Coverage> coverage;
  std::uint64_t done = 0;
  std::uint64_t ticks = 0;
  std::uint64_t next = 0;  // all sequences with lower numbers are done
  double seconds = 0;
  std::vector<std::string> crashes;
};

// A signal handler sets it. The exploration then ends early.
extern volatile std::sig_atomic_t interrupted;

Result explore(const Options& options, const std::vector<Variant>& variants);

}  // namespace servodrome::motion
