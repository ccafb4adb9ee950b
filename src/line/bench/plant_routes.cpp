#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <optional>

#include "line/bench/line_bench.hpp"
#include "links/number_text.hpp"

namespace servodrome::line::bench {
namespace {

// Returns the number of an input wire: "DI3" is wire 3.
int wire_of(const Axis& axis, std::string_view name) {
  int wire = -1;
  if (name.starts_with("DI")) wire = links::number_of_text<int>(name.substr(2)).value_or(-1);
  if (wire < 0 || wire >= axis.settings().product->input_wires) {
    throw ApiError{400, fmt::format("there is no input \"{}\"", name.substr(0, 40)), axis.settings().name,
                   fmt::format("inputs are DI0 .. DI{}", axis.settings().product->input_wires - 1)};
  }
  return wire;
}

}  // namespace

Json LineBench::show_inputs(Call& call) {
  const Axis& axis = axis_of(call);
  Json inputs = Json::object();
  for (int wire = 0; wire < axis.settings().product->input_wires; ++wire) {
    const auto forced = axis.forced_inputs().find(wire);
    const bool is_forced = forced != axis.forced_inputs().end();
    const bool level = is_forced ? forced->second : ((axis.feedback().inputs >> static_cast<unsigned>(wire)) & 1u) != 0;
    inputs[fmt::format("DI{}", wire)] = {{"level", level}, {"forced", is_forced}};
  }
  return Json{{"inputs", std::move(inputs)}};
}

Json LineBench::force_inputs(Call& call) {
  Axis& axis = axis_of(call);
  const BodyReader body(call.body);
  std::vector<std::pair<int, std::optional<bool>>> wanted;
  for (const auto& [name, value] : body.object().items()) {
    const int wire = wire_of(axis, name);
    if (!value.is_boolean() && !value.is_null()) {
      throw ApiError{400, fmt::format("{} is neither true, false nor null", name), name,
                     "true and false force the input, null connects it to its switch again"};
    }
    wanted.emplace_back(wire, value.is_null() ? std::nullopt : std::optional(value.get<bool>()));
  }
  for (const auto& [wire, level] : wanted) axis.force_input(wire, level);
  return show_inputs(call);
}

Json LineBench::show_plant(Call& call) {
  const Axis& axis = axis_of(call);
  const plant::Parameters& parameters = axis.plant().parameters();
  return Json{{"locked_rotor", axis.plant().rotor_locked()},
              {"load_torque_nm", parameters.load.external_torque_nm},
              {"load_inertia_kgm2", parameters.load.inertia_kgm2},
              {"friction_nm", parameters.load.coulomb_friction_nm},
              {"supply_v", parameters.supply.volts},
              {"ambient_c", parameters.thermal.ambient_c},
              {"position_counts", axis.plant().position_counts()}};
}

namespace {

// A number of the plant that may change while it runs. `change` changes the parameters, which plant::validate checks;
// `set` changes the plant.
struct Quantity {
  std::string_view key;
  void (*change)(plant::Parameters& parameters, double value);
  void (plant::Plant::*set)(double value);
};

constexpr std::array quantities{
    Quantity{"load_torque_nm", [](plant::Parameters& p, double value) { p.load.external_torque_nm = value; },
             &plant::Plant::set_external_torque_nm},
    Quantity{"load_inertia_kgm2", [](plant::Parameters& p, double value) { p.load.inertia_kgm2 = value; },
             &plant::Plant::set_load_inertia_kgm2},
    Quantity{"friction_nm",
             [](plant::Parameters& p, double value) {
               p.load.static_friction_nm =
                   std::max(p.load.static_friction_nm + (value - p.load.coulomb_friction_nm), value);
               p.load.coulomb_friction_nm = value;
             },
             &plant::Plant::set_coulomb_friction_nm},
    Quantity{"supply_v", [](plant::Parameters& p, double value) { p.supply.volts = value; },
             &plant::Plant::set_supply_v},
    Quantity{"ambient_c", [](plant::Parameters& p, double value) { p.thermal.ambient_c = value; },
             &plant::Plant::set_ambient_c},
};

// Checks all changes before the first one is made. Throws ApiError.
void check(const Axis& axis, const std::array<std::optional<double>, quantities.size()>& values,
           std::optional<std::int64_t> position) {
  const auto judge = [&axis](const plant::Parameters& parameters) {
    std::vector<std::string> messages = plant::validate(parameters);
    if (messages.empty() && axis.pair() != nullptr) {
      for (const std::string& message : axis.pair()->judge(axis, parameters)) messages.push_back("coupling." + message);
    }
    if (!messages.empty()) throw ApiError{422, messages.front(), "body", "choose a valid value for the plant"};
  };
  // Checks the changes one after the other, in the order in which they will be set, because the plant checks each of
  // them as well.
  plant::Parameters changed = axis.plant().parameters();
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    if (!values[i]) continue;
    quantities[i].change(changed, *values[i]);
    judge(changed);
  }
  if (!position) return;
  changed.encoder.start_position_counts = *position;
  judge(changed);
}

}  // namespace

Json LineBench::change_plant(Call& call) {
  Axis& axis = axis_of(call);
  plant::Plant& plant = axis.plant();
  BodyReader body(call.body);
  std::array<std::optional<double>, quantities.size()> values;
  for (std::size_t i = 0; i < quantities.size(); ++i) values[i] = body.number(quantities[i].key);
  const auto locked = body.boolean("locked_rotor");
  const auto position = body.signed_integer("position_counts");
  body.finish();
  check(axis, values, position);
  if (position && !axis.place(*position)) {
    throw ApiError{409, "the motor of " + axis.settings().name + " is energised", "position_counts",
                   "disable the drive first, or move the axis with a job"};
  }
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    if (values[i]) (plant.*quantities[i].set)(*values[i]);
  }
  if (locked) plant.lock_rotor(*locked);
  return show_plant(call);
}

}  // namespace servodrome::line::bench
