#pragma once

#include <functional>
#include <span>

#include "catalogue/departures.hpp"
#include "tools/conform/subject.hpp"

namespace servodrome::master::conform {

// All checks in the order of execution: first those that do not enable the axis, last those that reset the node.
std::span<const Check> all_checks();

struct RunOptions {
  bool safe = false;                // skips checks that enable or move the axis
  bool watch = true;                // on CAN, the drive monitors this program's heartbeat in such checks
  std::vector<std::string> only{};  // ids and groups to run; empty: all
  std::span<const catalogue::Departure> departures{};  // of the drive's product
  // Callbacks before and after each check.
  std::function<void(const Check&)> before{};
  std::function<void(const Outcome&)> after{};
};

// True if a check has this id or group.
bool is_check_or_group(std::string_view word);
// True if the options select the check and it exists for this kind of bus.
bool is_wanted(const Check& check, const RunOptions& options, unsigned bus_kind);

struct Report {
  std::vector<Outcome> outcomes;
  std::vector<std::string> problems;  // objects and states that could not be restored
  bool cancelled = false;
  // The checks after one of these are skipped.
  bool lost = false;    // the drive did not answer any more
  bool at_rest = true;  // false: the axis may be on or move

  std::size_t count(Verdict verdict) const;
};

// Runs the checks that the options select. After each check, brings the drive to rest and restores its objects; after
// the last, or if a callback throws, restores its bus state. Throws MasterError if the axis is enabled or its
// statusword cannot be read, and what a callback throws.
Report run_checks(Subject& subject, const RunOptions& options);

}  // namespace servodrome::master::conform
