#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "line/line.hpp"
#include "line/support.hpp"
#include "tools/conform/run.hpp"

// Complete drives of the products on one bus, in virtual time, for the tests that modify their frames.
namespace servodrome::master::conform::test {

using namespace std::chrono_literals;
using line::test::settings_of;

// 10 revolutions in either direction between the stops; no switches. The axis starts at `start_counts`.
inline std::string line_of(std::string_view product, std::string_view bus_type, std::string_view axis_keys,
                           int start_counts = 0) {
  return fmt::format(R"(
clock = "virtual"
[[bus]]
name = "bus"
type = "{}"
[[axis]]
name = "x"
product = "{}"
{}
[axis.travel]
low_stop = -2000000
high_stop = 2000000
start = {}
)",
                     bus_type, product, axis_keys, start_counts);
}

inline std::string text_of(const Outcome& outcome) {
  std::string text = fmt::format("{:<10} {} {}\n", name(outcome.verdict), outcome.check->id, outcome.reason);
  for (const Observation& one : outcome.observations) {
    if (!one.met) text += fmt::format("    sent {} / expected {} / seen {}\n", one.sent, one.expected, one.seen);
  }
  return text;
}

// Text of the outcomes with one of these verdicts.
inline std::string text_of(const Report& report, std::initializer_list<Verdict> verdicts) {
  std::string text;
  for (const Outcome& outcome : report.outcomes) {
    if (std::find(verdicts.begin(), verdicts.end(), outcome.verdict) != verdicts.end()) text += text_of(outcome);
  }
  for (const std::string& problem : report.problems) text += problem + "\n";
  return text;
}

// Expects no failure, and that every listed departure occurs.
inline void expect_departures_only(const Report& report) {
  EXPECT_EQ(text_of(report, {Verdict::fail}), "");
  for (const Outcome& outcome : report.outcomes) {
    if (outcome.verdict != Verdict::pass) continue;
    EXPECT_EQ(outcome.reason, "") << outcome.check->id << ": the departure is not there";
  }
  if (std::getenv("CONFORM_SHOW") != nullptr) fmt::print("{}", text_of(report, {Verdict::departure, Verdict::skipped}));
}

inline std::vector<std::string_view> failed(const Report& report) {
  std::vector<std::string_view> ids;
  for (const Outcome& outcome : report.outcomes) {
    if (outcome.verdict == Verdict::fail) ids.push_back(outcome.check->id);
  }
  return ids;
}

}  // namespace servodrome::master::conform::test
