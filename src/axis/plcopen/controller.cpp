#include "axis/plcopen/controller.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::master::plcopen {

Controller::Controller(CyclicBus& bus, std::span<const AxisConfiguration> configurations,
                       std::span<const MotionAxisOptions> options)
    : bus_(bus), group_(bus, options) {
  for (std::size_t i = 0; i < group_.size(); ++i) {
    axes_.emplace_back(group_.axis(i), configurations.empty() ? AxisConfiguration{}
                                                              : configurations[std::min(i, configurations.size() - 1)]);
  }
  group_.on_cycle([this] {
    ++cycle_;
    for (Axis& axis : axes_) axis.begin_cycle();
    if (program_) program_();
  });
  group_.on_set_points([this] {
    for (Axis& axis : axes_) axis.update(cycle_);
  });
}

bool Controller::run_until(const std::function<bool()>& done, Time timeout) {
  const Time end = bus_.now() + timeout;
  while (!done()) {
    if (bus_.now() >= end) return false;
    bus_.wait(std::min(bus_.period(), end - bus_.now()));
  }
  return true;
}

void Controller::run_for(Time span) {
  run_until([] { return false; }, span);
}

void Controller::shut_down(double deceleration, Time timeout) {
  // A stop needs a deceleration: without a valid one the axes use their greatest.
  const bool is_given = std::isfinite(deceleration) && deceleration > 0.0;
  const auto rests = [](Axis& axis) {
    const MotionAxis& motion = axis.motion();
    return !motion.is_enabled() || (motion.is_done() && motion.set_point().velocity == 0.0 && !motion.is_homing());
  };
  std::vector<MC_Stop> stops(axes_.size());
  std::vector<MC_Power> powers(axes_.size());
  bool at_rest = false;
  on_cycle([&] {
    bool all = true;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      stops[i].Execute = true;
      const double greatest = axes_[i].configuration().max_deceleration;
      stops[i].Deceleration = is_given ? std::min(deceleration, greatest) : greatest;
      stops[i](axes_[i]);
      all = all && !stops[i].Busy && rests(axes_[i]);
    }
    at_rest = all;
    for (std::size_t i = 0; at_rest && i < axes_.size(); ++i) powers[i](axes_[i]);
  });
  struct Unset {
    Controller& controller;
    ~Unset() { controller.on_cycle({}); }
  } const unset{*this};
  const auto is_off = [](Axis& axis) {
    const PowerState state = axis.motion().axis().state();
    return state != PowerState::operation_enabled && state != PowerState::quick_stop_active;
  };
  const auto all_off = [&] { return at_rest && std::all_of(axes_.begin(), axes_.end(), is_off); };
  if (run_until(all_off, timeout)) return;
  const auto late = std::find_if_not(axes_.begin(), axes_.end(), is_off);
  if (late == axes_.end()) return;
  throw MasterError("it is not switched off", late->motion().axis().where(), "check the bus; switch its power off");
}

void Controller::run(const std::function<void()>& program, double deceleration) {
  try {
    program();
  } catch (...) {
    try {
      shut_down(deceleration);
    } catch (const MasterError&) {
      // The link or a drive is lost; the first error says more.
    }
    throw;
  }
  shut_down(deceleration);
}

}  // namespace servodrome::master::plcopen
