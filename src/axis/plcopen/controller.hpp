#pragma once

#include <deque>

#include "axis/cyclic/motion_group.hpp"
#include "axis/plcopen/administrative_blocks.hpp"
#include "axis/plcopen/motion_blocks.hpp"

namespace servodrome::master::plcopen {

// A cyclic task for the drives of a bus, as in a PLC: in each cycle the axes read their inputs, the program runs with
// its function blocks, and the axes compute their set-points.
class Controller {
 public:
  // `bus` must outlive this. `configurations` and `options`: one for each drive in order; the last one also applies to
  // all further drives. Throws MasterError.
  explicit Controller(CyclicBus& bus, std::span<const AxisConfiguration> configurations = {},
                      std::span<const MotionAxisOptions> options = {});

  std::size_t size() const { return axes_.size(); }
  Axis& axis(std::size_t number) { return axes_[number]; }
  CyclicBus& bus() { return bus_; }

  // Sets the program, which runs once in each cycle.
  void on_cycle(std::function<void()> program) { program_ = std::move(program); }
  // Runs cycles until `done`, evaluated after each cycle, returns true; false after `timeout`. Throws MasterError if
  // the link is lost. Faults of axes do not throw: the program must check them.
  bool run_until(const std::function<bool()>& done, Time timeout);
  void run_for(Time span);
  // For the end of a program: stops all axes, in any state, and switches them off. Throws MasterError if an axis stays
  // enabled.
  void shut_down(double deceleration, Time timeout = std::chrono::seconds(5));
  // Calls `program`, and then shut_down(), also if the program throws. Rethrows the program's exception.
  void run(const std::function<void()>& program, double deceleration);

 private:
  CyclicBus& bus_;
  MotionGroup group_;
  std::deque<Axis> axes_;
  std::function<void()> program_;
  std::uint64_t cycle_ = 0;
};

}  // namespace servodrome::master::plcopen
