#pragma once

#include <string>
#include <vector>

namespace servodrome::scenario {

// A scenario file that is one step smaller than another one.
struct Reduction {
  std::string what;  // "without the rule \"mishap\""
  std::string text;
};

// Ways to make a scenario smaller by one step, the largest steps first: without a rule, without the expectations other
// than `kept`, without a condition or a random value, with fewer acts, with shorter times. A text need not be valid:
// the parser decides. Each rule, expectation and key must stand on lines of its own, as in the library.
std::vector<Reduction> reductions(const std::string& text, const std::string& kept);

}  // namespace servodrome::scenario
