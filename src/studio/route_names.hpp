#pragma once

#include "line/bench/body_reader.hpp"
#include "line/bench/routes.hpp"

// The names of the bench API that files with routes use.
namespace servodrome::studio {

using line::bench::ApiError;
using line::bench::BodyReader;
using line::bench::Call;
using line::bench::Json;
using line::bench::Method;
using line::bench::Route;

}  // namespace servodrome::studio
