#include "tools/conform/run.hpp"

#include <algorithm>

#include "catalogue/product.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform {

std::span<const Check> all_checks() {
  static const std::vector<Check> checks = [] {
    std::vector<Check> all;
    for (const auto table : check_tables) {
      const std::span<const Check> rows = table();
      all.insert(all.end(), rows.begin(), rows.end());
    }
    return all;
  }();
  return checks;
}

bool is_check_or_group(std::string_view word) {
  const auto checks = all_checks();
  return std::any_of(checks.begin(), checks.end(),
                     [word](const Check& check) { return check.id == word || check.group() == word; });
}

bool is_wanted(const Check& check, const RunOptions& options, unsigned bus_kind) {
  if ((check.buses & bus_kind) == 0) return false;
  return options.only.empty() || std::any_of(options.only.begin(), options.only.end(), [&](const std::string& word) {
           return check.id == word || check.group() == word;
         });
}

std::size_t Report::count(Verdict verdict) const {
  return static_cast<std::size_t>(std::count_if(
      outcomes.begin(), outcomes.end(), [verdict](const Outcome& outcome) { return outcome.verdict == verdict; }));
}

namespace {

bool is_about(const catalogue::Departure& departure, const Observation& observation) {
  const auto has = [&](const std::string& text) { return text.find(departure.about) != std::string::npos; };
  return has(observation.sent) || has(observation.expected) || has(observation.seen);
}

// A failure becomes a departure if a documented departure covers each failed observation.
void apply_departures(Outcome& outcome, const RunOptions& options) {
  if (outcome.verdict == Verdict::skipped) return;
  std::vector<const catalogue::Departure*> known;
  for (const catalogue::Departure& departure : options.departures) {
    if (departure.check == outcome.check->id) known.push_back(&departure);
  }
  if (known.empty()) return;
  std::vector<const catalogue::Departure*> used;
  for (const Observation& observation : outcome.observations) {
    if (observation.met) continue;
    const auto one = std::find_if(known.begin(), known.end(), [&](const catalogue::Departure* departure) {
      return is_about(*departure, observation);
    });
    if (one == known.end()) return;
    if (std::find(used.begin(), used.end(), *one) == used.end()) used.push_back(*one);
  }
  const bool departs = outcome.verdict == Verdict::fail;
  const auto& told = departs ? used : known;
  for (const catalogue::Departure* departure : told) {
    if (!outcome.reason.empty()) outcome.reason += "; ";
    outcome.reason += departure->reason;
  }
  if (departs) outcome.verdict = Verdict::departure;
  if (!departs) outcome.reason = "as the standard says, although a departure is listed: " + outcome.reason;
}

Outcome run_check(const Check& check, Subject& subject, const RunOptions& options) {
  Outcome outcome{.check = &check};
  const Time start = subject.services().now();
  Trial trial(subject, outcome);
  try {
    const bool watched = options.watch || subject.bus_kind() == buses::ethercat;
    if (watched && check.demand != Demand::nothing) subject.be_watched();
    check.run(trial, check.row);
  } catch (const Skipped& skipped) {
    // An observation that failed before the skip keeps the verdict at fail.
    if (outcome.verdict == Verdict::pass) outcome.verdict = Verdict::skipped;
    outcome.reason = skipped.why;
  } catch (const Ended&) {
  } catch (const MasterError& error) {
    trial.expect(false, "check where it stopped", "an answer with which the check can continue", error.what());
  }
  outcome.duration = subject.services().now() - start;
  return outcome;
}

}  // namespace

Report run_checks(Subject& subject, const RunOptions& options) {
  Report report;
  subject.refuse_if_enabled();
  try {
    for (const Check& check : all_checks()) {
      if (!is_wanted(check, options, subject.bus_kind())) continue;
      if (subject.settings().cancelled && subject.settings().cancelled()) throw Cancelled{};
      if (options.before) options.before(check);
      Outcome outcome;
      if (report.lost || !report.at_rest) {
        outcome = {.check = &check,
                   .verdict = Verdict::skipped,
                   .reason = report.lost ? "the link is lost" : "the axis could not be brought to rest"};
      } else if (options.safe && check.demand != Demand::nothing) {
        outcome = {.check = &check,
                   .verdict = Verdict::skipped,
                   .reason = check.demand == Demand::motion ? "--safe: it would move the axis"
                                                            : "--safe: it would enable the axis"};
      } else {
        const auto settle = [&] {
          for (const std::string& problem : subject.settle())
            report.problems.push_back(fmt::format("{}: {}", check.id, problem));
        };
        outcome = run_check(check, subject, options);
        // Repeats the check once if OP was lost: a computer that sends too late can cause that, while a faulty slave
        // leaves OP again.
        const bool is_repeated = outcome.verdict == Verdict::fail && subject.has_lost_operation();
        settle();
        if (is_repeated && !subject.is_lost() && subject.is_off()) {
          outcome = run_check(check, subject, options);
          settle();
        }
        report.lost = subject.is_lost();
        report.at_rest = subject.is_off();
        apply_departures(outcome, options);
      }
      if (options.after) options.after(outcome);
      report.outcomes.push_back(std::move(outcome));
    }
  } catch (const Cancelled&) {
    report.cancelled = true;
  } catch (...) {
    // For example, a callback could not write its output.
    try {
      subject.restore();
    } catch (...) {
      // The first exception is rethrown below; this one is ignored.
    }
    throw;
  }
  for (const std::string& problem : subject.restore()) report.problems.push_back(problem);
  report.lost = report.lost || subject.is_lost();
  report.at_rest = subject.is_off();
  return report;
}

}  // namespace servodrome::master::conform
