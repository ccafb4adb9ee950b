#pragma once

#include <functional>
#include <utility>

#include "axis/axis402.hpp"
#include "tools/script/script.hpp"

namespace servodrome::master::script {

// A script failed at a step: what() is "FILE:LINE:COLUMN: message". The axes have been commanded to stop.
class ScriptFailure : public std::runtime_error {
 public:
  ScriptFailure(const std::string& file, Place place, const std::string& message);
  Place place() const { return place_; }
  const std::string& message() const { return message_; }

 private:
  Place place_;
  std::string message_;
};

// Cancellation callback of a script, for run() and for AxisOptions::cancelled of each of its axes. A call that is
// cancelled waits for the standstill of its own axis before it throws. The other axes must not run on for that time:
// the first call that returns true lets all axes of the script begin to stop. Not thread-safe.
class Cancellation {
 public:
  explicit Cancellation(std::function<bool()> asked) : asked_(std::move(asked)) {}
  bool operator()() {
    if (!asked_()) return false;
    if (begin_stop_) std::exchange(begin_stop_, nullptr)();
    return true;
  }
  // Called by run().
  void on_first(std::function<void()> begin_stop) { begin_stop_ = std::move(begin_stop); }

 private:
  std::function<bool()> asked_;
  std::function<void()> begin_stop_{};
};

struct RunOptions {
  // Callbacks before and after each step; `said` is the output of the step ("6064:00 = 5"), empty for most.
  std::function<void(const Step&)> began{};
  std::function<void(const Step&, Time took, const std::string& said)> done{};
  Axis402::Progress progress{};          // called during motions
  Cancellation* cancellation = nullptr;  // true ends the script; the axes must call the same object
  Time poll_interval = std::chrono::milliseconds(5);
};

// Runs a script. `axes`: the axes that it declares, in that order, on one bus.
//
// Before any motion it reads the data that it needs from the axes: their units, and the size of objects that are not in
// the catalogue. After a `set` of an axis it reads the units of this axis again. During `wait` and `wait-until` it
// polls the axes that it has enabled, and the enabled axes that it has moved; during a motion it polls the axis of this
// motion. A fault ends the script. At the end, also after an error, it stops all these axes together. They remain
// enabled at rest.
//
// Throws ScriptFailure.
void run(const Script& script, std::span<Axis402* const> axes, const RunOptions& options = {});

}  // namespace servodrome::master::script
