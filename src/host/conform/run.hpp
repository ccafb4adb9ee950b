#pragma once

#include <functional>
#include <span>

#include "host/conform/departures.hpp"
#include "host/conform/subject.hpp"

namespace servodrome::host::conform {

// All there are, in the order in which they run: what needs nothing first, what resets the node last.
std::span<const Check> all_checks();

struct RunOptions {
  bool safe = false;                // what enables or moves the axis is left out
  std::vector<std::string> only{};  // ids and groups; empty: all
  std::string_view product{};       // whose departures count
  std::span<const Departure> departures = all_departures();
  // Called before and after each check.
  std::function<void(const Check&)> before{};
  std::function<void(const Outcome&)> after{};
};

// Is there a check of this id or group?
bool is_check_or_group(std::string_view word);
// Is the check among those that the options ask for, on this kind of bus?
bool is_wanted(const Check& check, const RunOptions& options, unsigned bus_kind);

struct Report {
  std::vector<Outcome> outcomes;
  std::vector<std::string> problems;  // what could not be put back
  bool cancelled = false;

  std::size_t count(Verdict verdict) const;
};

// Runs the checks that the options ask for, puts the drive at rest and its objects back after each, and its bus state
// after all of them. Throws HostError if the axis is enabled, or if the drive cannot be asked for that.
Report run_checks(Subject& subject, const RunOptions& options);

}  // namespace servodrome::host::conform
