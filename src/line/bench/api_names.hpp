#pragma once

#include "api/body_reader.hpp"
#include "api/routes.hpp"

// The names of the bench API that handlers of a line use.
namespace servodrome::line::bench {

using api::ApiError;
using api::BodyReader;
using api::Call;
using api::Json;
using api::Method;
using api::Route;

}  // namespace servodrome::line::bench
