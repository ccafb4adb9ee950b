#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "line/line.hpp"

namespace servodrome::scenario {

struct BenchAnswer {
  nlohmann::json body;
  std::string error{};  // with its remedy; empty: there is none
};

// Carries out a request to the bench API for the axis. `method` is "GET", "PUT", "POST" or "DELETE", `path` is the part
// behind /api/v1/axes/NAME.
BenchAnswer call_bench(line::Line& line, const line::Axis& axis, const std::string& method, const std::string& path,
                       const std::string& body = "");

}  // namespace servodrome::scenario
