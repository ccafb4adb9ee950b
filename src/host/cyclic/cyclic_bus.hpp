#pragma once

#include <functional>

#include "host/cyclic/process_image.hpp"
#include "links/time.hpp"

namespace servodrome::host {

using links::Time;

struct CycleCounters {
  std::uint64_t cycles = 0;
  std::uint64_t missed = 0;   // cycles to which some drive's process data were missing
  std::uint64_t skipped = 0;  // cycles that this program came too late for
  unsigned longest_miss = 0;  // cycles in a row
  Time worst_lateness{0};     // of a cycle's frames behind their time
};

// Several drives whose process data are exchanged at a fixed period: what is above it need not know the bus. One
// thread; cycles run while it waits.
class CyclicBus {
 public:
  virtual ~CyclicBus() = default;

  virtual Time period() const = 0;
  virtual Time now() const = 0;
  // Lets time pass, and cycles run. Throws HostError if the link is lost.
  virtual void wait(Time span) = 0;

  // The drives, in the order in which they were given.
  virtual std::size_t size() const = 0;
  virtual ProcessImage& image(std::size_t drive) = 0;
  // The last cycle brought all of its data.
  virtual bool is_fresh(std::size_t drive) const = 0;

  // Called once in each cycle, when its inputs are there: what goes out is made here. It does not wait.
  virtual void on_cycle(std::function<void()> action) = 0;

  // Throws HostError if a drive left the state in which it exchanges data, or too many cycles in a row were missed.
  virtual void check() const = 0;
  virtual CycleCounters counters() const = 0;
  // When the drives took the inputs of the last cycle: the time of its SYNC or frame.
  virtual Time inputs_taken() const { return now(); }
};

}  // namespace servodrome::host
