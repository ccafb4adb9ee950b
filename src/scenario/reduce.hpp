#pragma once

#include <string>
#include <vector>

namespace servodrome::scenario {

// A scenario file that is one step smaller than another one.
struct Reduction {
  std::string what;  // "without the rule \"mishap\""
  std::string text;
};

// The same text, in which each rule states its name: a rule without one has a name by its place.
std::string with_names(const std::string& text);

// Ways to make a scenario smaller by one step, the largest steps first: without a rule, without the expectations except
// `kept`, without a condition or a random value, with fewer acts, with shorter times. A text may be invalid: the parser
// decides. In the file each rule, expectation and key must be on lines of its own, as in the library.
std::vector<Reduction> reductions(const std::string& text, const std::string& kept);

}  // namespace servodrome::scenario
