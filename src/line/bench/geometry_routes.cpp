#include <fmt/format.h>

#include "line/bench/line_bench.hpp"

// The positions of stops, switches and index along the travel of an axis.
namespace servodrome::line::bench {
namespace {

Json counts_or_null(std::int64_t counts) {
  if (counts == plant::no_low_limit || counts == plant::no_high_limit) return nullptr;
  return counts;
}

// Returns the purpose of a switch. Limit switches extend to infinity; the home switch is on the product's home wire.
std::string_view purpose_of(const plant::Switch& fitted, const Product& product) {
  if (fitted.from_counts == plant::no_low_limit) return "negative_limit";
  if (fitted.to_counts == plant::no_high_limit) return "positive_limit";
  return fitted.wire == product.wiring.home ? "home" : "switch";
}

// Returns the kind of the load, for a drawing: crank or arm if the load has such parameters; otherwise linear if the
// travel has two ends, else rotary.
Json mechanics_of(const Axis& axis, bool has_ends) {
  const plant::Parameters& parameters = axis.plant().parameters();
  const plant::Load& load = parameters.load;
  const bool is_crank = load.crank_inertia_kgm2 > 0 || load.crank_torque_nm != 0;
  const bool is_arm = load.arm_torque_nm != 0;
  const char* kind = is_crank ? "crank" : is_arm ? "arm" : has_ends ? "linear" : "rotary";
  Json coupling = nullptr;
  if (const CoupledAxes* pair = axis.pair()) {
    coupling = {{"axis", pair->partner_of(axis).settings().name}, {"ratio", pair->ratio_of(axis)}};
  }
  return {{"kind", kind},
          {"counts_per_revolution", parameters.encoder.counts_per_revolution},
          {"cycle_revolutions", load.cycle_revolutions},
          {"cycle_offset_turns", load.cycle_offset_turns},
          {"crank_ratio", load.crank_ratio},
          {"hangs", load.gravity_torque_nm != 0},
          {"belt", load.belt_length_revolutions > 0},
          {"elastic", load.elastic},
          {"coupling", std::move(coupling)}};
}

}  // namespace

Json LineBench::show_geometry(Call& call) {
  const Axis& axis = axis_of(call);
  const plant::Parameters& parameters = axis.plant().parameters();
  Json geometry{{"negative_stop", counts_or_null(parameters.load.low_stop_counts)},
                {"positive_stop", counts_or_null(parameters.load.high_stop_counts)},
                {"negative_limit", nullptr},
                {"positive_limit", nullptr},
                {"home_from", nullptr},
                {"home_to", nullptr},
                {"index_every", nullptr},
                {"index_at", nullptr}};
  if (parameters.encoder.index_width_counts > 0) {
    geometry["index_every"] = parameters.encoder.counts_per_revolution;
    geometry["index_at"] = parameters.encoder.index_position_counts;
  }
  Json inputs = Json::object();
  Json switches = Json::array();
  for (std::size_t i = 0; i < parameters.switch_count; ++i) {
    const plant::Switch& fitted = parameters.switches[i];
    const std::string_view name = purpose_of(fitted, *axis.settings().product);
    const std::string wire = fmt::format("DI{}", fitted.wire);
    if (name == "negative_limit") {
      geometry["negative_limit"] = counts_or_null(fitted.to_counts);
    } else if (name == "positive_limit") {
      geometry["positive_limit"] = counts_or_null(fitted.from_counts);
    } else if (name == "home") {
      geometry["home_from"] = fitted.from_counts;
      geometry["home_to"] = fitted.to_counts;
    }
    if (name != "switch") inputs[std::string(name)] = wire;
    switches.push_back({{"name", name},
                        {"input", wire},
                        {"from", counts_or_null(fitted.from_counts)},
                        {"to", counts_or_null(fitted.to_counts)},
                        {"hysteresis", fitted.hysteresis_counts},
                        {"normally_closed", fitted.normally_closed}});
  }
  geometry["inputs"] = std::move(inputs);
  geometry["switches"] = std::move(switches);
  const auto is_there = [&geometry](const char* end) { return !geometry[end].is_null(); };
  geometry["mechanics"] = mechanics_of(axis, (is_there("negative_stop") || is_there("negative_limit")) &&
                                                 (is_there("positive_stop") || is_there("positive_limit")));
  return geometry;
}

}  // namespace servodrome::line::bench
