#pragma once

#include <span>

#include "api/http.hpp"
#include "api/routes.hpp"

namespace servodrome::api {

// The bench API without a socket: carries out `request` by the routes of `groups`, as docs/bench-api.md describes. A
// faulty request does not throw: the response then has a status of 4xx and nothing was changed. An exception of a
// handler becomes a response with status 500. If the response has a `piece`, the request must still be carried out. If
// it is `postponed`, nothing was done: the request has `only_if_urgent`, and its route is not urgent.
Response begin(const Request& request, std::span<const RouteGroup> groups);
// Carries out the next piece of a request. After the last piece the response has no `piece`.
void carry_out_piece(Response& response);
// Carries out all pieces and completes the body.
Response completed(Response response);

}  // namespace servodrome::api
