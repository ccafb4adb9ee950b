#pragma once

#include <vector>

#include "host/error.hpp"
#include "host/parameters/list.hpp"
#include "host/parameters/values.hpp"
#include "line/bench/routes.hpp"
#include "studio/service_objects.hpp"

// What commissioning asks of an axis beside its jobs, by the host library over the drive's service port, between two
// ticks: docs/bench-api.md, "Parameters" and what follows.
namespace servodrome::studio {

line::bench::RouteGroup parameter_routes();
line::bench::RouteGroup pdo_routes();

// All of them.
std::vector<line::bench::RouteGroup> commissioning_routes();

// An axis as these routes see it.
struct Subject {
  // Throws ApiError 409 if the axis has no power.
  Subject(line::Line& line, line::Axis& axis);

  ServiceObjects objects;
  host::NodeId node_id{};  // of a CANopen drive
  std::string product;
  std::span<const dictionary::Entry> table{};  // what its bus sees; of an axis without a fieldbus, all
  // The parameters as `servodrome params` has them: those of `table`.
  host::ParameterList parameters(bool with_connection = false) const;
};

// As the API tells it: `status`, and what, where and what to do.
line::bench::ApiError api_error(const host::HostError& error, unsigned status = 409);

// Of the query: absent or "false" is false, "true" is true. Throws ApiError 400.
bool flag(const line::bench::Call& call, std::string_view key);

}  // namespace servodrome::studio
