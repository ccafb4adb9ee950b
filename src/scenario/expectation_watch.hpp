#pragma once

#include <functional>

#include "scenario/verdict.hpp"
#include "scenario/watch.hpp"

namespace servodrome::scenario {

// Judges one expectation while time passes.
class ExpectationWatch {
 public:
  // The axes of its conditions; nullptr: none.
  ExpectationWatch(const Expectation& expectation, line::Axis* when, line::Axis* what, line::Axis* until);

  // Call this for each message. `concerns` tells whether a condition is about it.
  void notice(std::span<const Message> parts, const std::function<bool(const Watch&)>& concerns);
  // Call this in every tick.
  void look(Time now, const Facts& facts);
  bool decided() const { return phase_ == Phase::decided; }
  // The trial ends: decides the verdict if it is still open. An `eventually` whose time has not elapsed stays
  // undecided.
  void finish(Time now, const Facts& facts);
  const Verdict& verdict() const { return verdict_; }

 private:
  enum class Phase : std::uint8_t { waiting, watching, decided };
  void decide(Outcome outcome, Time now, std::string found);
  // The watch is over.
  void close(Time now, const Facts& facts);

  const Expectation* expectation_;
  Watch when_;
  std::optional<Watch> until_;
  Watch what_;
  Phase phase_ = Phase::waiting;
  Time began_{};
  Verdict verdict_;
};

}  // namespace servodrome::scenario
