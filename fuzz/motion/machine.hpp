#pragma once

#include <map>
#include <memory>
#include <optional>

#include "catalogue.hpp"
#include "coverage.hpp"
#include "masters.hpp"
#include "watch.hpp"

namespace servodrome::motion {

struct Outcome {
  std::optional<Finding> finding;
  std::uint64_t fingerprint = 0;  // of all that was seen
  std::int64_t ticks = 0;
};

// Where a run tells what happens, for people: a line for each change of state and each millisecond or so.
using Story = std::string;

struct RunOptions {
  CoverageBook* coverage = nullptr;
  Story* story = nullptr;
  std::int64_t story_ticks = 10 * ticks_per_ms;  // between two lines of it, where nothing happens
  bool recover = false;                          // at the end every axis is to be led back to Operation enabled
};

// A sequence that is carried out on a line of its own, in virtual time, with every tick watched.
class Life {
 public:
  Life(const Sequence& sequence, const RunOptions& options);
  ~Life();
  // Up to this tick of the sequence. False: something was found.
  bool run_to(std::int64_t tick);
  // What comes from now on, out of a sequence that is equal up to now.
  void go_on_with(const Sequence& sequence);
  // The rest, and the way back to Operation enabled where the options ask for it.
  Outcome end(bool recover);
  std::int64_t ticks() const;

 private:
  class Machine;
  std::unique_ptr<Machine> machine_;
};

// A whole sequence.
Outcome run(const Sequence& sequence, const RunOptions& options = {});

// The same, and once more where that is asked for: nothing may differ.
Outcome run_checked(const Sequence& sequence, const RunOptions& options, bool twice);

}  // namespace servodrome::motion
