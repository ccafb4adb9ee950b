#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <random>

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

// Values of the objects that the drive lets a master write.
template <typename Rig>
std::map<std::pair<unsigned, unsigned>, std::int64_t> writable_objects(Rig& rig) {
  std::map<std::pair<unsigned, unsigned>, std::int64_t> all;
  const dictionary::Dictionary& objects = rig.line.axes()[0]->device().dictionary();
  for (const dictionary::Entry& entry : objects.table()) {
    if (entry.access == dictionary::Access::rw && entry.fixed_size() && entry.index != 0x6040 && entry.index != 0x1003)
      all[{entry.index, entry.sub}] = objects.number(entry);
  }
  return all;
}

// Cancels each check that enables or moves the axis at random moments. The drive must be off, at rest and as before.
// CONFORM_MOMENTS: number of moments for each check. Process data overwrite the objects `ignored`.
template <typename Rig>
void cancel_each_check(std::string_view product, unsigned bus_kind, const std::vector<unsigned>& ignored = {}) {
  const char* wanted = std::getenv("CONFORM_MOMENTS");
  const int moments = wanted != nullptr ? std::atoi(wanted) : 1;
  std::mt19937 random(1);
  for (const Check& check : all_checks()) {
    if (check.demand == Demand::nothing || (check.buses & bus_kind) == 0) continue;
    Rig rig(product);  // the axis of a cancelled check stays where it is, so the next check has another one
    const auto shaft = [&] { return static_cast<double>(rig.line.axes()[0]->plant().position_counts()); };
    const auto shown = [&] {
      return static_cast<double>(rig.line.axes()[0]->device().dictionary().number(0x6064, 0)) - shaft();
    };
    int polls = 0;
    rig.cancelled = [&polls] {
      ++polls;
      return false;
    };
    const Report whole = rig.run({.only = {std::string(check.id)}});
    EXPECT_EQ(text_of(whole, {Verdict::fail}), "");
    EXPECT_EQ(rig.line.axes()[0]->device().dictionary().number(0x6041, 0) & 0x4F, 0x40) << check.id;
    const auto before = writable_objects(rig);
    const double value = shown();
    for (int moment = 0; moment < moments && polls > 0; ++moment) {
      int left = std::uniform_int_distribution(0, polls - 1)(random);
      const std::string where = fmt::format("{} at poll {} of {}", check.id, left, polls);
      rig.cancelled = [&left] { return --left < 0; };
      const Report report = rig.run({.only = {std::string(check.id)}});
      EXPECT_TRUE(report.at_rest) << where;
      for (const std::string& problem : report.problems) ADD_FAILURE() << where << ": " << problem;
      EXPECT_EQ(rig.line.axes()[0]->device().dictionary().number(0x6041, 0) & 0x4F, 0x40) << where;
      const double place = shaft();
      rig.line.run_until(rig.line.now() + 100ms);
      EXPECT_NEAR(shaft(), place, 200.0) << where;
      EXPECT_NEAR(shown(), value, 131072.0 / 25.0) << where;
      for (const auto& [object, number] : writable_objects(rig)) {
        if (std::find(ignored.begin(), ignored.end(), object.first) != ignored.end()) continue;
        EXPECT_EQ(number, before.at(object)) << fmt::format("{:04X}h:{:02X}, {}", object.first, object.second, where);
      }
    }
  }
}

}  // namespace servodrome::master::conform::test
