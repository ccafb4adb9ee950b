#include "api/bench.hpp"

#include <array>
#include <fmt/format.h>

#include "api/version.hpp"

namespace servodrome::api {
namespace {

template <Json (Bench::*Handler)(Call&)>
Json ask(Call& call) {
  return (static_cast<Bench*>(call.context)->*Handler)(call);
}

Json show_version(Call&) { return Json{{"name", "servodrome"}, {"version", version()}, {"api", 1}}; }

constexpr std::array bench_table{
    Route{Method::get, "/api/v1/version", show_version},
    Route{Method::get, "/api/v1/line", ask<&Bench::show_line>},
    Route{Method::get, "/api/v1/clock", ask<&Bench::show_clock>},
    Route{Method::put, "/api/v1/clock", ask<&Bench::set_speed>},
    Route{Method::post, "/api/v1/clock/advance", ask<&Bench::advance>},
    Route{Method::get, "/api/v1/axes", ask<&Bench::list_axes>},
    Route{Method::get, "/api/v1/axes/{}", ask<&Bench::show_axis>},
    Route{Method::get, "/api/v1/axes/{}/states", ask<&Bench::show_states>},
    Route{Method::get, "/api/v1/axes/{}/homing", ask<&Bench::show_homing>},
    Route{Method::get, "/api/v1/axes/{}/objects", ask<&Bench::list_objects>},
    Route{Method::get, "/api/v1/axes/{}/objects/{}/{}", ask<&Bench::read_object>},
    Route{Method::put, "/api/v1/axes/{}/objects/{}/{}", ask<&Bench::write_object>},
    Route{Method::get, "/api/v1/axes/{}/values?objects", ask<&Bench::read_values>},
    Route{Method::get, "/api/v1/axes/{}/faults", ask<&Bench::show_faults>},
    Route{Method::post, "/api/v1/axes/{}/faults", ask<&Bench::inject>},
    Route{Method::delete_, "/api/v1/axes/{}/faults", ask<&Bench::take_back>},
    Route{Method::post, "/api/v1/axes/{}/power", ask<&Bench::switch_power>},
    Route{Method::get, "/api/v1/axes/{}/geometry", ask<&Bench::show_geometry>},
    Route{Method::get, "/api/v1/axes/{}/inputs", ask<&Bench::show_inputs>},
    Route{Method::put, "/api/v1/axes/{}/inputs", ask<&Bench::force_inputs>},
    Route{Method::get, "/api/v1/axes/{}/plant", ask<&Bench::show_plant>},
    Route{Method::put, "/api/v1/axes/{}/plant", ask<&Bench::change_plant>},
    Route{Method::get, "/api/v1/buses", ask<&Bench::list_buses>},
    Route{Method::get, "/api/v1/buses/{}", ask<&Bench::show_bus>},
    Route{Method::post, "/api/v1/buses/{}/scan", ask<&Bench::scan_bus>},
    Route{Method::post, "/api/v1/buses/{}/disturb", ask<&Bench::start_disturbance>},
    Route{Method::delete_, "/api/v1/buses/{}/disturb", ask<&Bench::end_disturbance>},
};

}  // namespace

Json Bench::refuse(Call&) {
  throw ApiError{409, "this is possible with simulated drives only", "address",
                 fmt::format("{}; `servodrome up` runs simulated drives", no_plant)};
}

RouteGroup bench_routes(Bench& bench) { return {bench_table, &bench}; }

std::vector<Route> refused(std::initializer_list<std::span<const Route>> tables) {
  std::vector<Route> routes;
  for (const std::span<const Route> one : tables) routes.insert(routes.end(), one.begin(), one.end());
  for (Route& route : routes) route.act = Bench::refuse;
  return routes;
}

}  // namespace servodrome::api
