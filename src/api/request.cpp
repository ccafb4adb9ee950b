#include "api/request.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <optional>

#include "api/author.hpp"
#include "api/query.hpp"
#include "api/routes.hpp"

namespace servodrome::api {
namespace {

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

// Returns the parts of `path` in the places of {} in `pattern`, or nothing if the path does not match.
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

Response answer_of(Call& call, const Route& route) {
  const Json body = route.act(call);
  if (call.piece) {
    Response response;
    response.piece = [piece = std::move(call.piece)](Response& answer) {
      const Json json = piece();
      if (!json.is_null()) answer.body = to_text(json);
      return !json.is_null();
    };
    return response;
  }
  if (call.content)
    return {200, std::move(call.content->bytes), {}, std::move(call.content->type), std::move(call.content->more)};
  return {body.is_null() ? 204U : route.status, body.is_null() ? std::string() : to_text(body), {}};
}

// The search for a request's route, and its result.
struct Search {
  const Request& request;
  std::string_view path;
  std::string_view query;
  std::string allow{};  // methods of the routes whose pattern matches
  std::optional<Response> response{};
};

void search(Search& search, const RouteGroup& group) {
  for (const Route& route : group.routes) {
    const std::size_t query_begin = std::min(route.pattern.find('?'), route.pattern.size());
    auto arguments = match(route.pattern.substr(0, query_begin), search.path);
    if (!arguments) continue;
    if (route.method == search.request.method) {
      if (search.request.only_if_urgent && !route.is_urgent) return;
      const bool changes = search.request.method != Method::get;
      if (!route.is_urgent) {
        // An urgent request, such as a stop, is carried out even if its query has unknown keys.
        require_query_keys(search.query, route.pattern.substr(std::min(query_begin + 1, route.pattern.size())));
        if (changes) refuse_obsolete(search.request.obsolete);
      }
      Call call{std::move(*arguments), search.request.body, search.query, search.request.obsolete, group.context};
      search.response = answer_of(call, route);
      search.response->halts = call.halts;
      return;
    }
    search.allow += (search.allow.empty() ? "" : ", ") + std::string(word(route.method));
  }
}

// Makes a response of an ApiError (a refusal). Any other exception is a defect of the server and must end only this
// request.
template <typename Act>
Response answered(Act act) {
  try {
    return act();
  } catch (const ApiError& error) {
    return error_response(error);
  } catch (const std::exception& error) {
    return error_response({500, fmt::format("internal error of the server: {}", error.what()), "server",
                           "please report it with this request"});
  }
}

Response dispatch(const Request& request, std::span<const RouteGroup> groups) {
  const std::string_view target = request.target;
  const std::size_t end = std::min(target.find('?'), target.size());
  Search wanted{request, target.substr(0, end), target.substr(std::min(end + 1, target.size()))};
  for (const RouteGroup& group : groups) {
    search(wanted, group);
    if (wanted.response) return std::move(*wanted.response);
  }
  if (request.only_if_urgent) {
    Response postponed;
    postponed.postponed = true;
    return postponed;
  }
  if (wanted.allow.empty()) {
    return error_response({404, "unknown address", std::string(wanted.path.substr(0, 200)),
                           "docs/bench-api.md lists the addresses; they begin with /api/v1/"});
  }
  Response refusal = error_response(
      {405, "this address does not support the method", std::string(wanted.path), "it has " + wanted.allow});
  refusal.allow = wanted.allow;
  return refusal;
}

}  // namespace

void refuse_obsolete(std::string_view reason) {
  if (reason.empty()) return;
  throw ApiError{409, std::string(reason), "this request", "send it again if it shall be carried out"};
}

Response begin(const Request& request, std::span<const RouteGroup> groups) {
  const Author author(request.client.empty() ? "API" : fmt::format("API ({})", request.client));
  return answered([&] { return dispatch(request, groups); });
}

void carry_out_piece(Response& response) {
  Response::Piece piece = std::exchange(response.piece, {});
  response = answered([&] {
    Response next = std::move(response);
    if (!piece(next)) next.piece = std::move(piece);
    return next;
  });
}

Response completed(Response response) {
  while (response.piece) carry_out_piece(response);
  if (const More rest = std::exchange(response.more, {})) {
    for (std::string part = rest(); !part.empty(); part = rest()) response.body += part;
  }
  return response;
}

}  // namespace servodrome::api
