#pragma once

#include <initializer_list>

#include "api/routes.hpp"

namespace servodrome::api {

// The interface that the API's own routes call. A virtual line and drives on buses implement it. Each function is the
// handler of one route (docs/bench-api.md) and throws ApiError. Every bench has axes with objects, faults and states,
// buses and a clock. The other functions are capabilities: a bench that does not have one answers 409.
class Bench {
 public:
  virtual ~Bench() = default;

  virtual Json show_line(Call& call) = 0;  // with the capabilities that are missing
  virtual Json list_axes(Call& call) = 0;
  virtual Json show_axis(Call& call) = 0;
  virtual Json show_states(Call& call) = 0;
  virtual Json show_homing(Call& call) = 0;
  virtual Json list_objects(Call& call) = 0;
  virtual Json read_object(Call& call) = 0;
  virtual Json write_object(Call& call) = 0;
  virtual Json read_values(Call& call) = 0;
  virtual Json show_faults(Call& call) = 0;
  virtual Json list_buses(Call& call) = 0;
  virtual Json show_bus(Call& call) = 0;
  virtual Json scan_bus(Call& call) = 0;
  virtual Json show_clock(Call& call) = 0;

  // The machine behind the drives.
  virtual Json switch_power(Call& call) { return refuse(call); }
  virtual Json show_geometry(Call& call) { return refuse(call); }
  virtual Json show_inputs(Call& call) { return refuse(call); }
  virtual Json force_inputs(Call& call) { return refuse(call); }
  virtual Json show_plant(Call& call) { return refuse(call); }
  virtual Json change_plant(Call& call) { return refuse(call); }
  virtual Json inject(Call& call) { return refuse(call); }
  virtual Json take_back(Call& call) { return refuse(call); }
  // The buses' disturbances.
  virtual Json start_disturbance(Call& call) { return refuse(call); }
  virtual Json end_disturbance(Call& call) { return refuse(call); }
  // A clock that can be set.
  virtual Json set_speed(Call& call) { return refuse(call); }
  virtual Json advance(Call& call) { return refuse(call); }

  // The reason in the refusal of a capability.
  static constexpr const char* no_plant = "these are drives on a bus, and the program can only use what the bus offers";
  static Json refuse(Call& call);  // throws ApiError 409
};

// The routes that every server of the API has. `bench` must outlive the requests.
RouteGroup bench_routes(Bench& bench);

// Returns the routes of `tables`, which belong to libraries above this one, with a handler that refuses each request
// (409). For a bench that lacks their capability.
std::vector<Route> refused(std::initializer_list<std::span<const Route>> tables);

}  // namespace servodrome::api
