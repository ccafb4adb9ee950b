// Rules on the clock, SYNC0 and the cable of an EtherCAT slave.
#include <gmock/gmock.h>

#include "master/problem_of.hpp"
#include "scenario/segment.hpp"

namespace servodrome::scenario::test {
namespace ethercat_clock_rules_test {
namespace {

using master::test::problem_of;
using testing::HasSubstr;

// ---- Clock and SYNC0

// The time of the frames of counted_in_a_second(), which counts as well.
constexpr double frame_time_ns = 3000;

// The difference to one second of the time that the slave's clock counts while the line runs for a second, in ns.
std::int64_t counted_in_a_second(SegmentUnderRules& segment) {
  const auto time = [&] {
    segment.ask({{Command::bwr, segment.first(0x0900), 4}});
    return segment.read(0x0918, 8);
  };
  const std::uint64_t before = time();
  segment.run(1s);
  return static_cast<std::int64_t>(time() - before) - 1'000'000'000;
}

TEST(EthercatClockRules, TheClockJumps) {
  SegmentUnderRules segment("[[rule]]\nwhen = { time_ms = 500 }\ndo = \"clock\"\njump_ns = -300000\n");
  EXPECT_NEAR(static_cast<double>(counted_in_a_second(segment)), -300'000, frame_time_ns);
  EXPECT_NEAR(static_cast<double>(counted_in_a_second(segment)), 0, frame_time_ns);
}

TEST(EthercatClockRules, TheOscillatorIsWrong) {
  SegmentUnderRules segment("[[rule]]\ndo = \"clock\"\nppm = 900\nfor_ms = 1500\n");
  EXPECT_NEAR(static_cast<double>(counted_in_a_second(segment)), 900'000, frame_time_ns);
  segment.run(500ms);
  EXPECT_NEAR(static_cast<double>(counted_in_a_second(segment)), 0, frame_time_ns) << "the rule has ended";
}

TEST(EthercatClockRules, TheClockStands) {
  SegmentUnderRules segment("[[rule]]\nwhen = { time_ms = 500 }\nfor_ms = 200\ndo = \"clock\"\nstop = true\n");
  EXPECT_NEAR(static_cast<double>(counted_in_a_second(segment)), -200e6, 200e3);
}

// Each rule ends for itself, and none starts a clock that another one holds.
TEST(EthercatClockRules, TwoEndOneAfterTheOther) {
  SegmentUnderRules segment(R"(
[[rule]]
do = "clock"
ppm = 900
for_ms = 5500
[[rule]]
when = { time_ms = 1500 }
do = "clock"
ppm = 400
for_ms = 2000
[[rule]]
when = { time_ms = 6500 }
do = "clock"
stop = true
for_ms = 2000
[[rule]]
when = { time_ms = 6700 }
do = "clock"
ppm = 300
)");
  const auto error = [&segment] { return static_cast<double>(counted_in_a_second(segment)); };
  const auto run_to = [&segment](Time time) { segment.run(time - segment.line.now()); };
  EXPECT_NEAR(error(), 900'000, frame_time_ns);
  run_to(2s);
  EXPECT_NEAR(error(), 400'000, frame_time_ns) << "the rule that began last decides";
  run_to(4s);
  EXPECT_NEAR(error(), 900'000, frame_time_ns) << "the first one still acts";
  segment.x().power_off(segment.line.now());
  segment.x().power_on(segment.line.now());
  segment.run(10ms);
  EXPECT_NEAR(error(), 900'000 * 0.49, 1e5) << "also after a power cycle, until its end";
  run_to(7s);
  EXPECT_NEAR(error(), -1e9, frame_time_ns) << "another frequency does not start it";
  run_to(9s);
  EXPECT_NEAR(error(), 300'000, frame_time_ns);
  segment.director.finish();
  EXPECT_NEAR(error(), 0, frame_time_ns);
}

std::string sync0_in_operational(const std::string& how) {
  return "[[rule]]\nwhen = { al = \"operational\" }\ndo = \"sync0\"\n" + how + "\n";
}

TEST(EthercatClockRules, Sync0IsMissing) {
  SegmentUnderRules segment(sync0_in_operational("how = \"missing\""));
  segment.operate_until_rules(true);
  segment.master.wait(20ms);
  EXPECT_EQ(segment.slave().state(), AlState::safe_operational);
  EXPECT_EQ(segment.slave().status_code(), AlStatusCode::fatal_sync_error);
  EXPECT_GE(segment.acts(), 1U);
}

TEST(EthercatClockRules, Sync0IsMissingFromTheStart) {
  SegmentUnderRules segment("[[rule]]\ndo = \"sync0\"\nhow = \"missing\"\n");
  EXPECT_THAT(problem_of([&] { segment.operate(true); }), HasSubstr("002Dh"));
}

TEST(EthercatClockRules, Sync0ComesTwice) {
  SegmentUnderRules segment(sync0_in_operational("how = \"twice\""));
  segment.operate_until_rules(true);
  segment.master.wait(50ms);
  EXPECT_EQ(segment.slave().state(), AlState::safe_operational);
  EXPECT_EQ(segment.slave().status_code(), AlStatusCode::synchronization_error);
}

// The outputs still act, and the slave stays in Operational.
TEST(EthercatClockRules, Sync0ComesLate) {
  SegmentUnderRules segment(sync0_in_operational("late_us = 300"));
  master::CyclicExchange& exchange = segment.operate_until_rules(true);
  segment.master.wait(50ms);
  EXPECT_EQ(segment.slave().state(), AlState::operational);
  EXPECT_GE(segment.acts(), 40U);
  exchange.output(0, {0x607A, 0})->set<std::int32_t>(77);
  segment.master.wait(3ms);
  EXPECT_EQ(segment.x().device().dictionary().number(0x607A), 77);
}

// ---- Cables

// The cable in front of the first slave is the master's cable.
TEST(EthercatCableRules, OneCableUnderTwoWordsEndsWithItsLastRule) {
  SegmentUnderRules segment(R"(
[[rule]]
for_ms = 100
do = "cable"
[[rule]]
bus = "ecat"
when = { time_ms = 50 }
for_ms = 100
do = "cable"
)");
  EXPECT_FALSE(segment.bus().cable(0));
  segment.run(120ms);
  EXPECT_FALSE(segment.bus().cable(0)) << "the second rule still acts";
  segment.run(100ms);
  EXPECT_TRUE(segment.bus().cable(0));
}

}  // namespace
}  // namespace ethercat_clock_rules_test
}  // namespace servodrome::scenario::test
