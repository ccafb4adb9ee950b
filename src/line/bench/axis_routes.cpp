#include <fmt/format.h>

#include "line/bench/axis_view.hpp"
#include "line/bench/line_bench.hpp"

namespace servodrome::line::bench {

Json LineBench::list_axes(Call&) {
  Json axes = Json::array();
  for (const auto& axis : line_.axes()) {
    axes.push_back(view_of(line_, *axis));
  }
  return Json{{"axes", std::move(axes)}};
}

Json LineBench::show_axis(Call& call) {
  Axis& axis = axis_of(call);
  return view_of(line_, axis);
}

Json LineBench::switch_power(Call& call) {
  Axis& axis = axis_of(call);
  BodyReader body(call.body);
  body.required("action");
  const std::string action = body.string("action").value_or("");
  body.finish();
  if (action != "off" && action != "on" && action != "cycle") {
    throw ApiError{422, fmt::format("there is no action \"{}\"", action.substr(0, 40)), "action",
                   "send \"off\", \"on\" or \"cycle\""};
  }
  if (action != "on" || !axis.powered()) axis.note_command();
  if (action != "on") axis.power_off(line_.now());
  if (action != "off") axis.power_on(line_.now());
  return Json{{"powered", axis.powered()}};
}

}  // namespace servodrome::line::bench
