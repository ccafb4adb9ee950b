#include "line/bench/line_bench.hpp"

#include <fmt/format.h>

#include "links/nearest_name.hpp"

namespace servodrome::line::bench {

Axis& axis_argument(Line& line, const Call& call) {
  const std::string_view name = call.arguments.front();
  if (Axis* axis = line.find_axis(name)) return *axis;
  std::vector<std::string_view> names;
  for (const auto& axis : line.axes()) names.push_back(axis->settings().name);
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "address",
                 links::suggestion(name, names)};
}

Axis& LineBench::axis_of(const Call& call) const { return axis_argument(line_, call); }

// `bench` may end here: a response refers to the line, but not to the bench.
api::Response begin(Line& line, const api::Request& request, std::span<const api::RouteGroup> more) {
  LineBench bench(line);
  std::vector<api::RouteGroup> groups{api::bench_routes(bench)};
  groups.insert(groups.end(), more.begin(), more.end());
  return begin(request, groups);
}

api::Response handle(Line& line, const api::Request& request, std::span<const api::RouteGroup> more) {
  return api::completed(begin(line, request, more));
}

}  // namespace servodrome::line::bench
