#include "scenario/master_watch.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "canopen/301/sdo_wire.hpp"
#include "canopen/connection_set.hpp"
#include "drive/drive.hpp"

namespace servodrome::scenario {
namespace {

constexpr std::uint16_t fault_reset = 1U << 7U;
constexpr double least_cycle_s = 0.001;  // a master with a slower cycle may leave 60C2h at its default

// 60C2h: value x 10^index seconds.
double cycle_s(const drive::Objects& objects) {
  const double period = objects.interpolation_time_period_value * std::pow(10.0, objects.interpolation_time_index);
  return std::max(period, least_cycle_s);
}

}  // namespace

// Counts SDO requests on the wire that repeat an unanswered one. Segments of a block differ from each other, so only an
// equal frame is a repetition. An abort of the master between the two is no request of its own.
class MasterWatch::BusWatch final : public links::BusObserver {
 public:
  BusWatch(links::CanBus& bus, std::vector<std::pair<line::Axis*, MasterDeeds*>> axes)
      : bus_(bus), axes_(std::move(axes)), pending_(axes_.size()) {
    bus_.add_observer(*this);
  }
  ~BusWatch() override { bus_.remove_observer(*this); }
  BusWatch(const BusWatch&) = delete;
  BusWatch& operator=(const BusWatch&) = delete;

  void on_bus_event(const links::BusEvent& event) override {
    if (event.kind != links::BusEvent::Kind::frame || event.frame.extended || event.frame.remote) return;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      auto& [axis, deeds] = axes_[i];
      const std::uint32_t node = axis->device().node_id();
      if (event.frame.id == canopen::connection_set::sdo_response + node) pending_[i].reset();
      if (event.frame.id != canopen::connection_set::sdo_request + node) continue;
      if (event.frame.data[0] == canopen::sdo::abort_transfer) continue;
      if (pending_[i] && pending_[i]->data == event.frame.data) deeds->repeats.add(event.end);
      pending_[i] = event.frame;
    }
  }

 private:
  links::CanBus& bus_;
  std::vector<std::pair<line::Axis*, MasterDeeds*>> axes_;
  std::vector<std::optional<canopen::Frame>> pending_;  // the request of each axis that has no answer yet
};

MasterWatch::MasterWatch(line::Line& line) : line_(line) {
  for (const auto& axis : line.axes()) axes_.try_emplace(axis.get());
  for (const auto& bus : line.buses()) {
    std::vector<std::pair<line::Axis*, MasterDeeds*>> on_bus;
    for (const auto& axis : line.axes()) {
      const auto& its = axis->settings().bus;
      if (its && line.buses()[*its].get() == bus.get()) on_bus.emplace_back(axis.get(), &axes_[axis.get()].deeds);
    }
    buses_.push_back(std::make_unique<BusWatch>(bus->bus, std::move(on_bus)));
  }
}

MasterWatch::~MasterWatch() = default;

void MasterWatch::look(Time now) {
  for (const auto& axis : line_.axes()) {
    AxisWatch& watch = axes_.at(axis.get());
    watch.deeds.fault_resets.forget(now);
    watch.deeds.repeats.forget(now);
    const bool reset = axis->powered() && (axis->device().drive().axis().objects.controlword & fault_reset) != 0;
    if (reset && !watch.reset && watch.has_looked) watch.deeds.fault_resets.add(now);
    watch.reset = reset;
    look_at_set_point(*axis, watch);
    watch.has_looked = true;
  }
}

void MasterWatch::look_at_set_point(line::Axis& axis, AxisWatch& watch) {
  const drive::Drive& drive = axis.device().drive();
  const bool cyclic = axis.powered() && drive.state() == drive::PowerState::operation_enabled &&
                      drive.mode() == drive::Mode::cyclic_sync_position;
  const bool following = cyclic && drive.axis().commanded.has_value();
  if (following && !watch.following && watch.has_looked) {
    const drive::Axis& its = drive.axis();
    const std::int64_t actual = axis.device().dictionary().number(0x6064, 0);
    std::int64_t distance = *its.commanded - actual;
    if (const std::int64_t range = its.position_range(); range != 0) {  // the shorter way
      distance %= range;
      if (2 * std::abs(distance) > range) distance -= distance > 0 ? range : -range;
    }
    const double counts = std::abs(static_cast<double>(its.units.to_counts(distance)));
    if (counts > its.max_velocity(false) * cycle_s(its.objects) && !watch.deeds.jumped) {
      watch.deeds.jumped = true;
      watch.deeds.jump_revolutions = counts / its.units.counts_per_revolution;
    }
  }
  watch.following = following;
}

}  // namespace servodrome::scenario
