#include "line/line.hpp"

#include <algorithm>

namespace servodrome::line {

NamedBus::NamedBus(const BusSettings& its_settings)
    : settings(its_settings), bus({.bit_rate = its_settings.bit_rate, .ideal = its_settings.ideal}) {}

Line::Line(const LineSettings& settings) : clock_mode_(settings.clock) {
  for (const BusSettings& bus : settings.buses) buses_.push_back(std::make_unique<NamedBus>(bus));
  for (const SerialBusSettings& bus : settings.serial_buses) {
    serial_buses_.push_back(std::make_unique<NamedSerialBus>(bus));
  }
  for (const EthercatBusSettings& bus : settings.ethercat_buses) {
    ethercat_buses_.push_back(std::make_unique<NamedEthercatBus>(bus));
  }
  for (const AxisSettings& axis : settings.axes) {
    AxisBuses buses;
    if (axis.bus) buses.can = &buses_.at(*axis.bus)->bus;
    if (axis.ethercat) buses.ethercat = &ethercat_buses_.at(axis.ethercat->bus)->bus;
    if (axis.serial) {
      NamedSerialBus& serial = *serial_buses_.at(axis.serial->bus);
      buses.serial = &serial.line;
      buses.serial_silence = serial.settings.silence;
    }
    axes_.push_back(std::make_unique<Axis>(axis, buses));
    if (axes_.back()->sends()) senders_.push_back(axes_.back().get());
  }
  for (const CouplingSettings& each : settings.couplings) {
    couplings_.push_back(
        std::make_unique<CoupledAxes>(each.parameters, *axes_.at(each.axes[0]), *axes_.at(each.axes[1])));
  }
}

Time Line::next_bus_event() const {
  Time next = links::never;
  for (const auto& bus : buses_) next = std::min(next, bus->bus.next_event());
  for (const auto& bus : serial_buses_) next = std::min(next, bus->line.next_event());
  return next;
}

// The next instant at which an axis may send or something may arrive. Up to it each axis may run all its ticks in a
// row.
Time Line::next_instant(Time latest) const {
  Time instant = std::min(latest, next_bus_event());
  for (const Axis* axis : senders_) instant = std::min(instant, axis->next_appearance(now_));
  for (const Follower* follower : followers_) instant = std::min(instant, follower->next_deadline());
  return std::max(instant, now_);
}

// Returns the time at which an axis or a bus next does something that shows, as far as it is known now; at most
// `most_behind` after now().
Time Line::next_appearance() const {
  Time next = std::min(next_bus_event(), now_ + most_behind);
  for (const auto& axis : axes_) next = std::min(next, axis->next_appearance(now_));
  for (const Follower* follower : followers_) next = std::min(next, follower->next_deadline());
  return next;
}

void Line::run_to_instant(Time instant) {
  if (const std::int64_t tick = instant / tick_length; tick != tick_) {
    tick_ = tick;
    for (const auto& axis : axes_) axis->run_to(tick);
  }
  now_ = instant;
  for (const auto& bus : buses_) bus->bus.advance(instant);
  for (const auto& bus : serial_buses_) bus->line.advance(instant);
  for (const auto& axis : axes_) axis->poll(instant);
  for (Follower* follower : followers_) {
    if (follower->next_deadline() <= instant) follower->reached(instant);
  }
}

void Line::run_until(Time target) {
  changed();  // the caller may have changed something
  while (now_ < target || next_bus_event() <= target) run_to_instant(next_instant(target));
}

void Line::step(Time latest) {
  changed();
  run_to_instant(next_instant(std::min<Time>(latest, now_ + std::chrono::milliseconds(1))));
}

namespace {

template <typename Named>
Named* find_by_name(const std::vector<std::unique_ptr<Named>>& among, std::string_view name) {
  const auto found = std::find_if(among.begin(), among.end(), [name](const auto& it) {
    if constexpr (std::is_same_v<Named, Axis>) {
      return it->settings().name == name;
    } else {
      return it->settings.name == name;
    }
  });
  return found == among.end() ? nullptr : found->get();
}

}  // namespace

Axis* Line::find_axis(std::string_view name) const { return find_by_name(axes_, name); }
NamedBus* Line::find_bus(std::string_view name) const { return find_by_name(buses_, name); }
NamedSerialBus* Line::find_serial_bus(std::string_view name) const { return find_by_name(serial_buses_, name); }
NamedEthercatBus* Line::find_ethercat_bus(std::string_view name) const { return find_by_name(ethercat_buses_, name); }

modbus::Server* Line::find_unit(const NamedSerialBus& bus, std::uint8_t unit) const {
  const auto is_here = [this, &bus](const std::unique_ptr<Axis>& axis) {
    const auto& serial = axis->settings().serial;
    return serial && serial_buses_[serial->bus].get() == &bus;
  };
  const bool any = (unit == modbus::no_unit || unit == modbus::unspecified_unit) &&
                   std::count_if(axes_.begin(), axes_.end(), is_here) == 1;
  for (const auto& axis : axes_) {
    if (!is_here(axis)) continue;
    products::SerialPort* port = axis->serial_port();
    if (port != nullptr && (any || port->station() == unit)) return port->modbus();
  }
  return nullptr;
}

}  // namespace servodrome::line
