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
  std::map<std::string, Coverage>* coverage = nullptr;
  Story* story = nullptr;
  std::int64_t story_ticks = 10 * ticks_per_ms;  // between two lines of it, where nothing happens
  bool recover = false;                          // at the end every axis is to be led back to Operation enabled
};

// Carries a sequence out on a line of its own, in virtual time, and watches every tick.
Outcome run(const Sequence& sequence, const RunOptions& options = {});

// The same, and once more where that is asked for: nothing may differ.
Outcome run_checked(const Sequence& sequence, const RunOptions& options, bool twice);

}  // namespace servodrome::motion
