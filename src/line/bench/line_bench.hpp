#pragma once

#include "api/bench.hpp"
#include "api/request.hpp"
#include "line/bench/api_names.hpp"
#include "line/line.hpp"

namespace servodrome::line::bench {

// A line of virtual drives as a bench: it has every capability.
class LineBench final : public api::Bench {
 public:
  // `line` must outlive this object, and all pieces of its responses.
  explicit LineBench(Line& line) : line_(line) {}

  Json show_line(Call& call) override;
  Json list_axes(Call& call) override;
  Json show_axis(Call& call) override;
  Json show_states(Call& call) override;
  Json show_homing(Call& call) override;
  Json list_objects(Call& call) override;
  Json read_object(Call& call) override;
  Json write_object(Call& call) override;
  Json read_values(Call& call) override;
  Json show_faults(Call& call) override;
  Json list_buses(Call& call) override;
  Json show_bus(Call& call) override;
  Json scan_bus(Call& call) override;
  Json show_clock(Call& call) override;
  Json switch_power(Call& call) override;
  Json show_geometry(Call& call) override;
  Json show_inputs(Call& call) override;
  Json force_inputs(Call& call) override;
  Json show_plant(Call& call) override;
  Json change_plant(Call& call) override;
  Json inject(Call& call) override;
  Json take_back(Call& call) override;
  Json start_disturbance(Call& call) override;
  Json end_disturbance(Call& call) override;
  Json set_speed(Call& call) override;
  Json advance(Call& call) override;

 private:
  Axis& axis_of(const Call& call) const;

  Line& line_;
};

// Returns the axis that the first argument names. Throws ApiError 404.
Axis& axis_argument(Line& line, const Call& call);

// Both carry out a request on a line: begin() carries out its first piece (api/request.hpp), handle() all pieces.
// `more` are groups of routes in addition to the line's own.
api::Response begin(Line& line, const api::Request& request, std::span<const api::RouteGroup> more = {});
api::Response handle(Line& line, const api::Request& request, std::span<const api::RouteGroup> more = {});

}  // namespace servodrome::line::bench
