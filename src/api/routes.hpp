#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "api/error.hpp"

// The operations of the API, in tables: those of a bench (bench.hpp), and those that libraries above this one add.
namespace servodrome::api {

// A response body that is not JSON.
struct Content {
  std::string type;  // "text/csv; charset=utf-8"
  std::string bytes;
  More more{};  // generates the rest of a long body
};

// Carries out a piece of a request. Returns null if there are more pieces.
using JsonPiece = std::function<Json()>;

struct Call {
  std::vector<std::string_view> arguments;  // the parts of the address in the places of {}
  const std::string& body;
  std::string_view query{};          // the part of the address behind the ?, as sent
  std::string_view obsolete{};       // Request::obsolete, for the handler of an urgent route
  void* context = nullptr;           // of the route's group
  std::optional<Content> content{};  // if set by the handler, sent instead of the JSON
  JsonPiece piece{};                 // if set by the handler, its last result is sent instead of the handler's
  bool halts = false;                // set by the handler: it has halted axes
};

// The value of Route::is_urgent for requests that bring axes to rest, or that show that a dead man's switch is still
// held. A request that begins a motion is urgent too if a stop has the same address, because the rate limit does not
// interpret the body. Such requests are short.
inline constexpr bool urgent = true;

struct Route {
  Method method;
  std::string_view pattern;  // "/api/v1/axes/{}", with the keys of the query: "/api/v1/changes?since&limit"
  Json (*act)(Call& call);   // throws ApiError; null: 204 without a body
  unsigned status = 200;     // of a response with a body, such as 201 for a new object
  bool is_urgent = false;    // the rate limit delays only long series of such requests (HttpServer)
};

// Throws ApiError 409 if `reason` (Request::obsolete) is not empty.
void refuse_obsolete(std::string_view reason);

// Routes and the data that their handlers need. `context` must outlive the requests.
struct RouteGroup {
  std::span<const Route> routes;
  void* context = nullptr;
};

}  // namespace servodrome::api
