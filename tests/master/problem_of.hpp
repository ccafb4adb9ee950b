#pragma once

#include <string>

#include "master/error.hpp"

namespace servodrome::master::test {

// The error message of the call; "" if it succeeds.
template <typename Call>
std::string problem_of(Call call) {
  try {
    call();
  } catch (const MasterError& error) {
    return error.what();
  }
  return "";
}

}  // namespace servodrome::master::test
