#pragma once

#include "api/body_reader.hpp"
#include "api/routes.hpp"

// The names of the bench API that files with routes use.
namespace servodrome::studio {

using api::ApiError;
using api::BodyReader;
using api::Call;
using api::Json;
using api::Method;
using api::Route;

}  // namespace servodrome::studio
