#include "line/bench/api.hpp"

#include <array>
#include <fmt/format.h>
#include <optional>

#include "line/bench/routes.hpp"
#include "line/nearest_name.hpp"

namespace servodrome::line::bench {
namespace {

constexpr std::array groups{axis_routes, object_routes, plant_routes, fault_routes, bus_routes, clock_routes};

std::string_view word(Method method) {
  switch (method) {
    case Method::get: return "GET";
    case Method::put: return "PUT";
    case Method::post: return "POST";
    case Method::delete_: return "DELETE";
    case Method::other: return "?";
  }
  return "?";
}

std::string_view next_segment(std::string_view& path) {
  if (path.starts_with('/')) path.remove_prefix(1);
  const std::string_view segment = path.substr(0, path.find('/'));
  path.remove_prefix(segment.size());
  return segment;
}

// What stands for the {} of `pattern` in `path`, or nothing if it does not match.
std::optional<std::vector<std::string_view>> match(std::string_view pattern, std::string_view path) {
  std::vector<std::string_view> arguments;
  while (!pattern.empty() && !path.empty()) {
    const std::string_view expected = next_segment(pattern);
    const std::string_view found = next_segment(path);
    if (expected == "{}") {
      arguments.push_back(found);
    } else if (expected != found) {
      return std::nullopt;
    }
  }
  if (!pattern.empty() || !path.empty()) return std::nullopt;
  return arguments;
}

Response dispatch(Line& line, const Request& request) {
  const std::string_view path = std::string_view(request.target).substr(0, request.target.find('?'));
  Response refusal = error_response({404, "there is nothing at this address", std::string(path.substr(0, 200)),
                                     "docs/bench-api.md lists the addresses; they begin with /api/v1/"});
  for (const auto group : groups) {
    for (const Route& route : group()) {
      auto arguments = match(route.pattern, path);
      if (!arguments) continue;
      if (route.method == request.method) {
        Call call{line, std::move(*arguments), request.body};
        const Json body = route.act(call);
        return {body.is_null() ? 204U : 200U, body.is_null() ? std::string() : to_text(body), {}};
      }
      const std::string allow = refusal.allow + (refusal.allow.empty() ? "" : ", ") + std::string(word(route.method));
      refusal = error_response({405, "this address does not have that method", std::string(path), "it has " + allow});
      refusal.allow = allow;
    }
  }
  return refusal;
}

}  // namespace

Axis& axis_argument(Call& call) {
  const std::string_view name = call.arguments.front();
  if (Axis* axis = call.line.find_axis(name)) return *axis;
  std::vector<std::string_view> names;
  for (const auto& axis : call.line.axes()) names.push_back(axis->settings().name);
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "address", suggestion(name, names)};
}

Response handle(Line& line, const Request& request) {
  try {
    return dispatch(line, request);
  } catch (const ApiError& error) {
    return error_response(error);
  }
}

}  // namespace servodrome::line::bench
