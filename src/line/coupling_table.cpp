#include "line/coupling_table.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/nearest_name.hpp"

namespace servodrome::line {
namespace {

constexpr const char* form_of_axes = "write axes = [\"NAME\", \"NAME\"], two axes of this file";

// Returns the index of the axis that `element` names. nullopt: there is none, which is reported.
std::optional<std::size_t> axis_of(const toml::node& element, const LineSettings& settings, TableReader& reader) {
  const auto* text = element.as_string();
  std::vector<std::string_view> names;
  for (const AxisSettings& axis : settings.axes) names.push_back(axis.name);
  const auto found = std::find(names.begin(), names.end(), text != nullptr ? text->get() : std::string());
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  reader.report().complain(
      element.source().begin,
      fmt::format("{}: {}", reader.name_of("axes"),
                  text != nullptr ? fmt::format("there is no axis \"{}\"", text->get()) : "is not a string"),
      text != nullptr ? links::suggestion(text->get(), names) : form_of_axes);
  return std::nullopt;
}

// Returns the index of the axis' EtherCAT segment. The frames of a segment let its axes advance ahead of the axes on
// other buses.
std::optional<std::size_t> segment_of(const AxisSettings& axis) {
  return axis.ethercat ? std::optional(axis.ethercat->bus) : std::nullopt;
}

// Reads the names of the two axes. Returns false if they cannot be coupled, which is reported.
bool read_axes(TableReader& reader, const LineSettings& settings, CouplingSettings& coupling) {
  const toml::node* node = reader.node("axes");
  const toml::array* array = node != nullptr ? node->as_array() : nullptr;
  if (array == nullptr || array->size() != coupling.axes.size()) {
    reader.complain("axes", node == nullptr ? "is missing" : "is not a list of two axes", form_of_axes);
    return false;
  }
  bool all = true;
  for (std::size_t i = 0; i < coupling.axes.size(); ++i) {
    const toml::node& element = *array->get(i);
    const auto axis = axis_of(element, settings, reader);
    all = all && axis;
    if (!axis) continue;
    coupling.axes[i] = *axis;
    const auto has_it = [&axis](const CouplingSettings& other) {
      return std::find(other.axes.begin(), other.axes.end(), *axis) != other.axes.end();
    };
    if (std::none_of(settings.couplings.begin(), settings.couplings.end(), has_it)) continue;
    reader.report().complain(
        element.source().begin,
        fmt::format("{}: \"{}\" is coupled already", reader.name_of("axes"), settings.axes[*axis].name),
        "an axis is part of one coupling at most");
    all = false;
  }
  if (!all) return false;
  const AxisSettings& first = settings.axes[coupling.axes[0]];
  const AxisSettings& second = settings.axes[coupling.axes[1]];
  if (coupling.axes[0] == coupling.axes[1]) {
    reader.complain("axes", fmt::format("couples \"{}\" to itself", first.name), form_of_axes);
    return false;
  }
  if (segment_of(first) != segment_of(second)) {
    reader.complain("axes",
                    fmt::format("\"{}\" and \"{}\" are not on the same EtherCAT segment", first.name, second.name),
                    "couple axes of one segment, or axes on CAN buses and RS485 lines");
    return false;
  }
  return true;
}

}  // namespace

void read_coupling(TableReader& reader, LineSettings& settings) {
  CouplingSettings coupling;
  const bool joins = read_axes(reader, settings, coupling);
  reader.read(coupling.parameters, coupling_keys);
  reader.finish();
  if (!joins) return;
  const auto of = [&](std::size_t i) -> const plant::Parameters& { return settings.axes[coupling.axes[i]].plant; };
  settings.couplings.push_back(coupling);
  // The limits of stiffness and damping depend on the axes, so the file must be right up to here.
  if (!reader.report().diagnostics.empty()) return;
  for (const std::string& message : plant::validate(coupling.parameters, of(0), of(1))) {
    const std::size_t colon = message.find(": ");
    reader.complain(message.substr(0, colon), message.substr(colon + 2), "see docs/line-file.md, \"Coupled axes\"");
  }
}

}  // namespace servodrome::line
