#include "line/line.hpp"

#include <algorithm>

namespace servodrome::line {

NamedBus::NamedBus(const BusSettings& its_settings)
    : settings(its_settings), bus({.bit_rate = its_settings.bit_rate, .ideal = its_settings.ideal}) {}

Line::Line(const LineSettings& settings) : clock_mode_(settings.clock) {
  for (const BusSettings& bus : settings.buses) buses_.push_back(std::make_unique<NamedBus>(bus));
  for (const AxisSettings& axis : settings.axes) {
    axes_.push_back(std::make_unique<Axis>(axis, buses_.at(axis.bus)->bus));
  }
}

Time Line::next_bus_event() const {
  Time next = links::never;
  for (const auto& bus : buses_) next = std::min(next, bus->bus.next_event());
  return next;
}

// Between two instants no axis can send and nothing arrives, so that each axis may run all its ticks before the next.
Time Line::next_instant(Time latest) const {
  Time instant = std::min(latest, next_bus_event());
  for (const auto& axis : axes_) instant = std::min(instant, axis->next_sending(now_));
  return std::max(instant, now_);
}

void Line::run_to_instant(Time instant) {
  const std::int64_t tick = instant / tick_length;
  for (const auto& axis : axes_) axis->run_to(tick);
  now_ = instant;
  for (const auto& bus : buses_) bus->bus.advance(instant);
  for (const auto& axis : axes_) axis->poll(instant);
}

void Line::run_until(Time target) {
  while (now_ < target || next_bus_event() <= target) run_to_instant(next_instant(target));
}

void Line::step() { run_to_instant(next_instant(now_ + std::chrono::milliseconds(1))); }

Axis* Line::find_axis(std::string_view name) const {
  for (const auto& axis : axes_) {
    if (axis->settings().name == name) return axis.get();
  }
  return nullptr;
}

NamedBus* Line::find_bus(std::string_view name) const {
  for (const auto& bus : buses_) {
    if (bus->settings.name == name) return bus.get();
  }
  return nullptr;
}

}  // namespace servodrome::line
