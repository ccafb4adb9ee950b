#pragma once

#include <deque>
#include <functional>
#include <span>

#include "host/cyclic/cyclic_bus.hpp"
#include "host/cyclic/motion_axis.hpp"

namespace servodrome::host {

// The drives of a bus as axes in one loop: each cycle all axes read, then the program runs, then all write. What the
// program (or the caller, between two waits) commands to several axes starts in the same cycle.
class MotionGroup {
 public:
  // `bus` outlives this. `options` for each drive in order; those that are missing are like the last. Throws HostError.
  explicit MotionGroup(CyclicBus& bus, std::span<const MotionAxisOptions> options = {});
  ~MotionGroup() { bus_.on_cycle({}); }
  MotionGroup(const MotionGroup&) = delete;
  MotionGroup& operator=(const MotionGroup&) = delete;

  std::size_t size() const { return axes_.size(); }
  MotionAxis& axis(std::size_t number) { return axes_[number]; }
  CyclicBus& bus() { return bus_; }

  // Runs in each cycle, between inputs and outputs.
  void on_cycle(std::function<void()> program) { program_ = std::move(program); }

  // Runs when the set-points of the next cycle are there, before they are written: for axes that follow others.
  void on_set_points(std::function<void()> action) { on_set_points_ = std::move(action); }

  // Waits at most `timeout` until `done`, which is asked each cycle; false: it was not. Throws HostError when an axis
  // that is switched on has a fault, which names it.
  bool wait_until(const std::function<bool()>& done, Time timeout);
  void wait(Time span);

  // ---- For people: these wait. They throw HostError when it does not come about in `timeout`. ----
  void enable(Time timeout = std::chrono::seconds(5));
  // Stops all within `limits`, then takes them to switch on disabled.
  void disable(const MotionLimits& limits, Time timeout = std::chrono::seconds(5));
  void reset_faults(Time timeout = std::chrono::seconds(5));

  // All start in the same cycle, from standstill, and arrive in the same: the axis that needs longest sets the time,
  // the others' limits are scaled to it. `targets` for each axis in order, and `limits`; those that are missing are
  // like the last. Returns the duration in seconds; 0 if all are there.
  double start_together(std::span<const double> targets, std::span<const MotionLimits> limits);
  bool all_done() const;

 private:
  void cycle();
  void throw_faults() const;

  CyclicBus& bus_;
  std::deque<MotionAxis> axes_;
  std::function<void()> program_;
  std::function<void()> on_set_points_;
  std::function<bool()> watch_;
  bool seen_ = false;
};

}  // namespace servodrome::host
