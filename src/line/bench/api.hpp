#pragma once

#include <span>

#include "line/bench/http.hpp"
#include "line/bench/routes.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// The bench API without a socket: what docs/bench-api.md says about `request`, done to `line` at its present time.
// Never throws for what is in a request: refusals are responses with status 4xx, and then nothing was changed.
// `more` are groups beside the line's own.
Response handle(Line& line, const Request& request, std::span<const RouteGroup> more = {});

}  // namespace servodrome::line::bench
