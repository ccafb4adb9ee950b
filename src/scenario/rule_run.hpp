#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <map>

#include "scenario/verdict.hpp"
#include "scenario/watch.hpp"

namespace servodrome::scenario {

// The value of an object at a past time, for Show::How::late.
struct PastValue {
  Time at{};
  std::int64_t value = 0;
};

// The memory of a rule about one object.
struct ObjectMemory {
  std::int64_t frozen = 0;        // of Show::How::freeze
  std::deque<PastValue> history;  // of Show::How::late
  std::uint64_t raised = 0;       // of Ignore: masked bits of the last write
};

// A write that Hold has already acknowledged to the master, but that takes effect later.
struct HeldWrite {
  Time due{};
  std::uint32_t start = 0;  // of the drive: Axis::starts
  const dictionary::Entry* entry = nullptr;
  std::array<std::byte, 8> bytes{};
  std::size_t size = 0;
};

// The state of a rule during a run of the scenario.
struct RuleRun {
  using Phase = RulePhase;

  // `condition_axis` is the axis of its conditions.
  RuleRun(const Rule& its_rule, line::Axis* its_axis, line::Axis* condition_axis, std::size_t its_number)
      : rule(&its_rule), axis(its_axis), number(its_number), when(its_rule.when, condition_axis) {
    if (its_rule.until) until.emplace(*its_rule.until, condition_axis);
  }

  // Returns true if the rule acts on the next matching message. It changes nothing, so it may be called again for the
  // same message.
  bool fires(std::uint64_t seed) const;
  // Call this when a matching message has passed. `fired`: the rule acted on the message.
  void passed(bool fired) {
    ++seen;
    if (fired) ++acts;
  }
  bool exhausted() const {
    const std::optional<unsigned> most = rule->most_acts();
    return most && acts >= *most;
  }
  // The delay of the message, including the random part.
  Time lateness(const Delay& delay, std::uint64_t seed) const;

  const Rule* rule;
  line::Axis* axis;  // nullptr: the rule acts on a bus
  std::size_t number;
  Watch when;
  std::optional<Watch> until;
  Phase phase = Phase::waiting;
  bool begun = false;  // at least once
  bool ready = true;   // `when` has been false since the last beginning
  Time began{};
  std::uint64_t seen = 0;                         // messages that matched since the beginning
  std::uint64_t acts = 0;                         // since the beginning
  std::uint64_t all_acts = 0;                     // acts of earlier runs of the rule
  std::uint64_t generation = 0;                   // number of beginnings
  std::deque<HeldWrite> held_writes{};            // of Hold
  std::map<std::uint8_t, ObjectMemory> memories;  // by the sub-indices of the rule's object
  std::string error;                              // the reason why the rule could not act
};

}  // namespace servodrome::scenario
