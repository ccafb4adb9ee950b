#pragma once

#include <span>

#include "line/bench/http.hpp"
#include "line/bench/routes.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// The bench API without a socket: what docs/bench-api.md says about `request`, done to `line` at its present time.
// Never throws for what is in a request: refusals are responses with status 4xx, and then nothing was changed. An
// exception of a handler is a response with status 500.
// A response with a `piece` is of a request that is still to be carried out.
// `more` are groups beside the line's own.
Response begin(Line& line, const Request& request, std::span<const RouteGroup> more = {});
// The same of the groups alone. `line` is what their handlers are given: without axes, if there are none but real ones.
Response begin_in(Line& line, const Request& request, std::span<const RouteGroup> groups);
// Carries out the next piece of a request; the last leaves a response without one.
void carry_out_piece(Response& response);
// As begin(), with all pieces carried out and the body complete.
Response handle(Line& line, const Request& request, std::span<const RouteGroup> more = {});

}  // namespace servodrome::line::bench
