#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "line/bench/error.hpp"
#include "line/line.hpp"

// The table of what the API can do, in groups; each group is a file.
namespace servodrome::line::bench {

struct Call {
  Line& line;
  std::vector<std::string_view> arguments;  // what stood for the {} of the pattern
  const std::string& body;
};

struct Route {
  Method method;
  std::string_view pattern;  // "/api/v1/axes/{}"
  Json (*act)(Call& call);   // throws ApiError; null: 204 without a body
};

std::span<const Route> axis_routes();
std::span<const Route> object_routes();
std::span<const Route> plant_routes();
std::span<const Route> fault_routes();
std::span<const Route> bus_routes();
std::span<const Route> clock_routes();

// The axis that an argument names. Throws 404.
Axis& axis_argument(Call& call);

}  // namespace servodrome::line::bench
