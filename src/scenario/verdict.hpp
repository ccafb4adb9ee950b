#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "links/time.hpp"

namespace servodrome::scenario {

enum class Outcome : std::uint8_t { passed, failed, not_reached };

// The judgement of one expectation.
struct Verdict {
  std::string name;
  Outcome outcome = Outcome::not_reached;
  links::Time at{};   // when it was decided, or when the watch began
  std::string found;  // the observed state, as text
};

enum class RulePhase : std::uint8_t { waiting, active, over };

// The acts of a rule, for reports.
struct RuleReport {
  std::string name;
  std::string action;  // its word
  std::string where;   // the axis, or the bus
  RulePhase phase = RulePhase::waiting;
  std::uint64_t acts = 0;
  std::optional<links::Time> first_act;
  std::string error;  // why it could not act; empty: no error
};

}  // namespace servodrome::scenario
