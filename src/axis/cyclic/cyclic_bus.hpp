#pragma once

#include <functional>

#include "links/time.hpp"
#include "master/process_image.hpp"

namespace servodrome::master {

using links::Time;

struct CycleCounters {
  std::uint64_t cycles = 0;
  std::uint64_t missed = 0;   // cycles without the process data of at least one drive
  std::uint64_t skipped = 0;  // cycles that were not run because the program was late
  unsigned longest_miss = 0;  // most missed cycles in a row
  Time worst_lateness{0};     // longest delay of a cycle's frames
};

// Cyclic process data of several drives, with a fixed period, on any bus. Single thread: cycles run inside wait().
class CyclicBus {
 public:
  virtual ~CyclicBus() = default;

  virtual Time period() const = 0;
  virtual Time now() const = 0;
  // Waits for `span` and runs the cycles. Throws MasterError if the link is lost.
  virtual void wait(Time span) = 0;

  // The drives, in the order given to the constructor.
  virtual std::size_t size() const = 0;
  virtual ProcessImage& image(std::size_t drive) = 0;
  // True if the last cycle received all process data of the drive.
  virtual bool is_fresh(std::size_t drive) const = 0;

  // `action` is called once in each cycle, after the inputs have arrived; it computes the outputs. It must not block.
  virtual void on_cycle(std::function<void()> action) = 0;

  // Throws MasterError if a drive has left the state in which it exchanges data, or if too many cycles in a row were
  // missed.
  virtual void check() const = 0;
  virtual CycleCounters counters() const = 0;
  // Time at which the drives sampled the inputs of the last cycle: the time of its SYNC or frame.
  virtual Time inputs_taken() const { return now(); }
};

}  // namespace servodrome::master
