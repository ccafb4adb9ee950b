#include "scenario/expectation_watch.hpp"

#include <fmt/format.h>
#include <utility>

namespace servodrome::scenario {
namespace {

double ms(Time time) { return std::chrono::duration<double, std::milli>(time).count(); }

}  // namespace

ExpectationWatch::ExpectationWatch(const Expectation& expectation, line::Axis* when, line::Axis* what,
                                   line::Axis* until)
    : expectation_(&expectation), when_(expectation.when, when), what_(expectation.what, what) {
  if (expectation.until) until_.emplace(*expectation.until, until);
  verdict_.name = expectation.name;
  verdict_.found = "the moment at which the watch begins never came";
  when_.begin();
}

void ExpectationWatch::notice(std::span<const Message> parts, const std::function<bool(const Watch&)>& concerns) {
  const auto tell = [&](Watch& watch) {
    if (concerns(watch)) watch.notice(parts);
  };
  if (phase_ == Phase::waiting) tell(when_);
  if (phase_ == Phase::watching) {
    if (until_) tell(*until_);
    tell(what_);
  }
}

void ExpectationWatch::decide(Outcome outcome, Time now, std::string found) {
  phase_ = Phase::decided;
  verdict_.outcome = outcome;
  verdict_.at = now;
  verdict_.found = std::move(found);
}

void ExpectationWatch::look(Time now, const Facts& facts) {
  using Kind = Expectation::Kind;
  if (phase_ == Phase::waiting && when_.holds(now, facts)) {
    phase_ = Phase::watching;
    began_ = now;
    verdict_.at = now;
    if (until_) until_->begin();
    what_.begin();
  }
  if (phase_ != Phase::watching) return;
  const bool holds = what_.holds(now, facts);
  switch (expectation_->kind) {
    case Kind::eventually:
      if (holds) {
        return decide(Outcome::passed, now, fmt::format("after {:.1f} ms", ms(now - began_)));
      }
      if (expectation_->within && now > began_ + *expectation_->within) {
        return decide(Outcome::failed, now,
                      fmt::format("not within {:.0f} ms: {}", ms(*expectation_->within), what_.present(facts)));
      }
      break;
    case Kind::always:
      if (!holds) return decide(Outcome::failed, now, what_.present(facts));
      break;
    case Kind::never:
      if (holds) return decide(Outcome::failed, now, what_.present(facts));
      break;
  }
  const bool over =
      (until_ && until_->holds(now, facts)) || (expectation_->lasts && now >= began_ + *expectation_->lasts);
  if (over) close(now, facts);
}

void ExpectationWatch::finish(Time now, const Facts& facts) {
  if (phase_ != Phase::watching) return;
  const auto& within = expectation_->within;
  if (expectation_->kind == Expectation::Kind::eventually && within && now < began_ + *within) {
    decide(Outcome::not_reached, now,
           fmt::format("the trial ended {:.0f} ms after the watch began, before its {:.0f} ms were over: {}",
                       ms(now - began_), ms(*within), what_.present(facts)));
  } else {
    close(now, facts);
  }
}

void ExpectationWatch::close(Time now, const Facts& facts) {
  if (expectation_->kind == Expectation::Kind::eventually) {
    decide(Outcome::failed, now, "not by the end: " + what_.present(facts));
  } else {
    decide(Outcome::passed, now, "");
  }
}

}  // namespace servodrome::scenario
