#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace servodrome::scenario {

// A scenario file that is one step smaller than another one.
struct Reduction {
  std::string what;  // "without the rule \"mishap\""
  std::string text;
};

// All functions throw std::runtime_error if the text is not valid TOML. Their results have no comments.

// The same scenario, in which each rule has an explicit name; a rule without a name gets one from its position.
std::string with_names(const std::string& text);

// The same scenario with this line file; and with this seed, unless the file states a seed.
std::string with_line(const std::string& text, const std::string& line);
std::string with_seed(const std::string& text, std::uint64_t seed);

// Ways to make a scenario smaller by one step, the largest steps first: without a rule, without the expectations except
// `kept`, without a condition or a random value, with fewer acts, with shorter times. A text may be invalid: the parser
// decides.
std::vector<Reduction> reductions(const std::string& text, const std::string& kept);

}  // namespace servodrome::scenario
