#pragma once

#include <chrono>
#include <string>

namespace servodrome::scope {

using Time = std::chrono::nanoseconds;

// A recorded number, as the files show it.
struct Channel {
  std::string name{};
  std::string unit{};  // "": unknown
};

// The shortest text of a number: "131072", "0.5".
std::string text_of_number(double number);

}  // namespace servodrome::scope
