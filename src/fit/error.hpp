#pragma once

#include <stdexcept>
#include <string>

namespace servodrome::fit {

// An error in a recording: location, error and remedy. what() joins the three into one sentence.
class Error : public std::runtime_error {
 public:
  Error(const std::string& where, const std::string& happened, const std::string& remedy)
      : std::runtime_error(where + ": " + happened + "; " + remedy) {}
};

}  // namespace servodrome::fit
