#pragma once

#include <deque>

#include "host/cyclic/motion_group.hpp"
#include "host/plcopen/administrative_blocks.hpp"
#include "host/plcopen/motion_blocks.hpp"

namespace servodrome::host::plcopen {

// A cyclic task over the drives of a bus, as a controller has: each cycle the axes take their inputs, the program runs
// with its function blocks, and the axes make their set-points.
class Controller {
 public:
  // `bus` outlives this. `configurations` for each drive in order; those that are missing are like the last. Throws
  // HostError.
  explicit Controller(CyclicBus& bus, std::span<const AxisConfiguration> configurations = {},
                      std::span<const MotionAxisOptions> options = {});

  std::size_t size() const { return axes_.size(); }
  Axis& axis(std::size_t number) { return axes_[number]; }
  CyclicBus& bus() { return bus_; }

  // The program, once a cycle.
  void on_cycle(std::function<void()> program) { program_ = std::move(program); }
  // Lets cycles run until the program has made `done` true (asked after each cycle), at most `timeout`; false: it was
  // not. Throws HostError if the link is lost; what befalls an axis is for the program to see.
  bool run_until(const std::function<bool()>& done, Time timeout);
  void run_for(Time span);
  // Brings all axes to rest and switches them off, whatever they do, for the end of a program. Throws HostError when
  // one stays enabled.
  void shut_down(double deceleration, Time timeout = std::chrono::seconds(5));

 private:
  CyclicBus& bus_;
  MotionGroup group_;
  std::deque<Axis> axes_;
  std::function<void()> program_;
  std::uint64_t cycle_ = 0;
};

}  // namespace servodrome::host::plcopen
