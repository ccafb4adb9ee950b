#pragma once

#include <deque>
#include <exception>
#include <functional>
#include <span>

#include "axis/cyclic/cyclic_bus.hpp"
#include "axis/cyclic/motion_axis.hpp"

namespace servodrome::master {

// The drives of a bus as axes in one loop. In each cycle all axes read, then the program runs, then all axes write.
// Commands to several axes by the program, or by the caller between two waits, start in the same cycle.
class MotionGroup {
 public:
  // `bus` must outlive this. `options`: one for each drive in order; the last one also applies to all further drives.
  // Throws MasterError.
  explicit MotionGroup(CyclicBus& bus, std::span<const MotionAxisOptions> options = {});
  // Removes the program, and sets the controlword of each enabled drive to quick stop. The bus sends it in its next
  // cycle, or at its end.
  ~MotionGroup();
  MotionGroup(const MotionGroup&) = delete;
  MotionGroup& operator=(const MotionGroup&) = delete;

  std::size_t size() const { return axes_.size(); }
  MotionAxis& axis(std::size_t number) { return axes_[number]; }
  CyclicBus& bus() { return bus_; }

  // `program` runs in each cycle, between inputs and outputs.
  void on_cycle(std::function<void()> program) { program_ = std::move(program); }

  // `action` runs after the set-points of the next cycle are computed and before they are written: for axes that follow
  // others.
  void on_set_points(std::function<void()> action) { on_set_points_ = std::move(action); }

  // Waits until `done`, called in each cycle, returns true; false after `timeout`. Throws MasterError with the name of
  // the fault if an axis that is switched on has one.
  bool wait_until(const std::function<bool()>& done, Time timeout);
  void wait(Time span);

  // ---- Blocking calls. They throw MasterError if the drives do not reach the state within `timeout`. ----
  void enable(Time timeout = std::chrono::seconds(5));
  // Stops all axes within `limits`, then brings the drives to switch on disabled. An axis that does not come to rest
  // within `timeout` gets a quick stop. If an axis has or gets a fault, or a quick stop, the others are stopped and
  // disabled all the same; then the call throws the first fault. Limits that are not above 0 throw and change nothing.
  void disable(const MotionLimits& limits, Time timeout = std::chrono::seconds(5));
  // A reset that is not done in time is cancelled.
  void reset_faults(Time timeout = std::chrono::seconds(5));

  // Starts a move of all axes in the same cycle, from standstill, so that they also arrive in the same cycle: the
  // slowest axis sets the duration, and the limits of the others are scaled down to it. `targets`: one for each axis in
  // order. `limits`: in the same order; the last one also applies to all further axes. Returns the duration in seconds;
  // 0 if all are at their targets. Throws MasterError, and starts no axis, if one of them cannot start.
  double start_together(std::span<const double> targets, std::span<const MotionLimits> limits);
  bool all_done() const;

 private:
  void cycle();
  std::exception_ptr present_fault() const;
  bool run_until(const std::function<bool()>& done, Time timeout, const std::function<void()>& after_cycle);

  CyclicBus& bus_;
  std::deque<MotionAxis> axes_;
  std::function<void()> program_;
  std::function<void()> on_set_points_;
  std::function<bool()> watch_;
  bool seen_ = false;
};

}  // namespace servodrome::master
