#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "line/bench/error.hpp"
#include "line/line.hpp"

// The table of what the API can do, in groups; each group is a file. Libraries above this one add groups of their own
// (LineServer::add_routes).
namespace servodrome::line::bench {

// An answer that is no JSON.
struct Content {
  std::string type;  // "text/csv; charset=utf-8"
  std::string bytes;
  More more{};  // of a long one: what follows
};

// Carries out a piece of a request; null: there is more to be done.
using JsonPiece = std::function<Json()>;

struct Call {
  Line& line;                               // of a server of real drives one without axes
  std::vector<std::string_view> arguments;  // what stood for the {} of the pattern
  const std::string& body;
  std::string_view query{};          // what stood behind the ? of the address, as it was sent
  void* context = nullptr;           // of the route's group
  std::optional<Content> content{};  // if the handler sets it, it is sent instead of the JSON
  JsonPiece piece{};                 // if the handler sets it, its last answer is sent instead of the handler's
};

struct Route {
  Method method;
  std::string_view pattern;  // "/api/v1/axes/{}"
  Json (*act)(Call& call);   // throws ApiError; null: 204 without a body
  unsigned status = 200;     // of the answer with a body, e.g. 201 for something made
};

// Routes with what their handlers need beside the line; the context outlives the requests.
struct RouteGroup {
  std::span<const Route> routes;
  void* context = nullptr;
};

std::span<const Route> axis_routes();
std::span<const Route> object_routes();
std::span<const Route> plant_routes();
std::span<const Route> fault_routes();
std::span<const Route> geometry_routes();
std::span<const Route> homing_routes();
std::span<const Route> state_routes();
std::span<const Route> bus_routes();
std::span<const Route> clock_routes();

// The axis that an argument names. Throws 404.
Axis& axis_argument(Call& call);

// The value of a key in the query, as it was sent: "?after=12" has "12" under "after". Nothing if the key is not there.
std::optional<std::string_view> query_value(const Call& call, std::string_view key);
// Of an argument or a value of the query: %XX is the byte, + a space.
std::string unescaped(std::string_view text);

}  // namespace servodrome::line::bench
