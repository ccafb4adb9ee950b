#include "studio/commissioning.hpp"

#include <fmt/format.h>

#include "line/bench/line_bench.hpp"

namespace servodrome::studio {

using api::ApiError;

Subject LineSubjects::open(api::Call& call) {
  line::Axis& axis = line::bench::axis_argument(line_, call);
  if (!axis.powered()) {
    throw ApiError{409, "the axis has no power", axis.settings().name,
                   "switch it on: POST .../power {\"action\": \"on\"}"};
  }
  products::Device& device = axis.device();
  const bool on_fieldbus = axis.settings().bus || axis.settings().ethercat;
  Subject subject{.client = std::make_unique<ServiceObjects>(line_, axis),
                  .product = std::string(axis.settings().product->name),
                  .table = on_fieldbus ? device.bus_dictionary().table() : device.dictionary().table()};
  if (axis.settings().bus) subject.node_id = device.node_id();
  return subject;
}

master::ParameterList Subject::parameters(bool with_connection) const {
  return master::ParameterList::of_dictionary(table, master::parameter_rules_of(product), with_connection);
}

ApiError api_error(const master::MasterError& error, unsigned status) {
  return {status, error.happened(), error.where(), error.remedy()};
}

bool flag(const api::Call& call, std::string_view key) {
  const auto value = api::query_value(call, key);
  if (!value || value == "false") return false;
  if (value == "true") return true;
  throw ApiError{400, fmt::format("{} is \"{}\"", key, value->substr(0, 40)), "address",
                 fmt::format("write {}=true, or leave it out", key)};
}

}  // namespace servodrome::studio
