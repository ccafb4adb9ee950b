#pragma once

#include <stdexcept>
#include <string>

namespace servodrome::fit {

// What is wrong with a recording: where, what, and what to do about it. what() is the three in one sentence.
class Error : public std::runtime_error {
 public:
  Error(const std::string& where, const std::string& happened, const std::string& remedy)
      : std::runtime_error(where + ": " + happened + "; " + remedy) {}
};

}  // namespace servodrome::fit
