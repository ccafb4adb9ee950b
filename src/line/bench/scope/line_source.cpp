#include "line/bench/scope/line_source.hpp"

#include <fmt/format.h>

#include "api/scope/channel_list.hpp"
#include "line/bench/axis_view.hpp"
#include "links/nearest_name.hpp"

namespace servodrome::line::bench {

std::vector<std::string> LineSource::axes() const {
  std::vector<std::string> names;
  for (const auto& axis : line_.axes()) names.push_back(axis->settings().name);
  return names;
}

Axis& LineSource::find(std::string_view name) const {
  if (Axis* axis = line_.find_axis(name)) return *axis;
  std::vector<std::string_view> names;
  for (const auto& axis : line_.axes()) names.push_back(axis->settings().name);
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "axis",
                 links::suggestion(name, names)};
}

api::NamedChannel LineSource::channel(const Channel& channel, Json view) {
  return {channel.axis->settings().name, std::move(view),
          [this, channel](std::int64_t stride) -> std::shared_ptr<api::Samples> { return taps_.open(channel, stride); },
          [channel] { return channel.value(); }};
}

namespace {

// "DI0 .. DI5, DO0 .. DO3"
std::string wires_of(const Product& product) {
  std::string text = fmt::format("DI0 .. DI{}", product.input_wires - 1);
  if (product.output_wires > 0) text += fmt::format(", DO0 .. DO{}", product.output_wires - 1);
  return text;
}

}  // namespace

api::NamedChannel LineSource::signal(Axis& axis, std::string_view name) {
  const Channel found = signal_channel(axis, name);
  if (found.read == nullptr) {
    std::vector<std::string_view> names;
    for (const line::Signal& signal : line::signals()) names.push_back(signal.name);
    throw ApiError{422, fmt::format("there is no signal \"{}\"", name.substr(0, 40)), axis.settings().name,
                   links::suggestion(name, names) + "; inputs and outputs are " + wires_of(*axis.settings().product)};
  }
  std::string_view unit;
  for (const line::Signal& signal : line::signals()) {
    if (signal.name == name) unit = signal.unit;
  }
  return channel(found, {{"axis", axis.settings().name}, {"signal", name}, {"name", name}, {"unit", unit}});
}

api::NamedChannel LineSource::object(Axis& axis, std::uint16_t index, std::uint8_t sub) {
  const std::string text = fmt::format("{:04X}:{:02X}", index, sub);
  const dictionary::Entry* entry = axis.device().dictionary().find(index, sub);
  const Channel found = entry != nullptr ? object_channel(axis, *entry) : Channel{};
  if (found.read == nullptr) {
    throw ApiError{422, fmt::format("{} {}", text, entry == nullptr ? "does not exist" : "is not a readable number"),
                   axis.settings().name, "GET /api/v1/axes/" + axis.settings().name + "/objects lists the objects"};
  }
  return channel(found,
                 {{"axis", axis.settings().name}, {"object", text}, {"name", entry->name}, {"unit", entry->unit}});
}

std::int64_t LineSource::stride_of(double rate_hz, const std::vector<api::NamedChannel>&) const {
  return api::stride_of_rate(rate_hz);
}

std::vector<Json> LineSource::views() {
  std::vector<Json> views;
  for (const auto& axis : line_.axes()) views.push_back(view_of(line_, *axis));
  return views;
}

Json LineSource::clock() { return clock_view(line_); }

}  // namespace servodrome::line::bench
