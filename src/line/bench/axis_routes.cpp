#include <array>
#include <fmt/format.h>

#include "line/bench/axis_view.hpp"
#include "line/bench/body_reader.hpp"
#include "line/bench/routes.hpp"

namespace servodrome::line::bench {
namespace {

Json list_axes(Call& call) {
  Json axes = Json::array();
  for (const auto& axis : call.line.axes()) {
    axes.push_back(view_of(call.line, *axis));
  }
  return Json{{"axes", std::move(axes)}};
}

Json show_axis(Call& call) {
  Axis& axis = axis_argument(call);
  return view_of(call.line, axis);
}

Json switch_power(Call& call) {
  Axis& axis = axis_argument(call);
  BodyReader body(call.body);
  body.required("action");
  const std::string action = body.string("action").value_or("");
  body.finish();
  if (action != "off" && action != "on" && action != "cycle") {
    throw ApiError{422, fmt::format("there is no action \"{}\"", action.substr(0, 40)), "action",
                   "send \"off\", \"on\" or \"cycle\""};
  }
  if (action != "on") axis.power_off(call.line.now());
  if (action != "off") axis.power_on(call.line.now());
  return Json{{"powered", axis.powered()}};
}

constexpr std::array axis_table{
    Route{Method::get, "/api/v1/axes", list_axes},
    Route{Method::get, "/api/v1/axes/{}", show_axis},
    Route{Method::post, "/api/v1/axes/{}/power", switch_power},
};

}  // namespace

std::span<const Route> axis_routes() { return axis_table; }

}  // namespace servodrome::line::bench
