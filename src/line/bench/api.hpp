#pragma once

#include <span>

#include "line/bench/http.hpp"
#include "line/bench/routes.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// The bench API without a socket: carries out `request` on `line` at its present time, as docs/bench-api.md describes.
// A faulty request does not throw: the response then has a status of 4xx and nothing was changed. An exception of a
// handler becomes a response with status 500. If the response has a `piece`, the request must still be carried out.
// `more` are groups of routes in addition to the line's own.
Response begin(Line& line, const Request& request, std::span<const RouteGroup> more = {});
// The same for `groups` only. Their handlers receive `line`, which has no axes if the server has real drives only.
Response begin_in(Line& line, const Request& request, std::span<const RouteGroup> groups);
// Carries out the next piece of a request. After the last piece the response has no `piece`.
void carry_out_piece(Response& response);
// Like begin(), but carries out all pieces and completes the body.
Response handle(Line& line, const Request& request, std::span<const RouteGroup> more = {});

}  // namespace servodrome::line::bench
