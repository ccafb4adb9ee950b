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
  std::uint64_t fingerprint = 0;  // hash of everything observed
  std::int64_t ticks = 0;
};

// The log of a run, for people: a line for each change of statusword or mode, and one at regular intervals.
using Story = std::string;

struct RunOptions {
  CoverageBook* coverage = nullptr;
  Story* story = nullptr;
  std::int64_t story_ticks = 10 * ticks_per_ms;  // interval of its lines if nothing changes
  bool recover = false;                          // at the end every axis must get back to Operation enabled
};

// One run of a sequence on a line of its own, in virtual time. The invariants are checked after every tick.
class Life {
 public:
  Life(const Sequence& sequence, const RunOptions& options);
  ~Life();
  // Runs up to this tick of the sequence. Returns false if an invariant is broken.
  bool run_to(std::int64_t tick);
  // Continues with the rest of this sequence, which must be equal to the present one up to now.
  void go_on_with(const Sequence& sequence);
  // Runs the rest of the sequence. With `recover`, brings the axes back to Operation enabled afterwards.
  Outcome end(bool recover);
  std::int64_t ticks() const;

 private:
  class Machine;
  std::unique_ptr<Machine> machine_;
};

// Runs a whole sequence.
Outcome run(const Sequence& sequence, const RunOptions& options = {});

// The same. With `twice` it runs the sequence a second time; a different result is a finding.
Outcome run_checked(const Sequence& sequence, const RunOptions& options, bool twice);

}  // namespace servodrome::motion
