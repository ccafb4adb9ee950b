// Rules on the frames of an EtherCAT segment, as a master sees them.
#include <gmock/gmock.h>
#include <set>

#include "scenario/segment.hpp"

namespace servodrome::scenario::test {
namespace ethercat_frame_rules_test {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

constexpr std::uint16_t al_status = 0x0130;
constexpr std::uint16_t scratch = 0x2800;

std::vector<unsigned> counters(const std::vector<Back>& datagrams) {
  std::vector<unsigned> all;
  for (const Back& one : datagrams) all.push_back(one.counter);
  return all;
}

TEST(EthercatFrameRules, OnlyTheDatagramThatMatchesCountsWrong) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame", command = "APRD", address = 0x0130 }
do = "working_counter"
add = -1
skip = 1
times = 1
)");
  const auto ask = [&] {
    return counters(segment.ask({{Command::brd, segment.first(al_status)},
                                 {Command::aprd, segment.first(al_status)},
                                 {Command::aprd, segment.first(0x0000)}}));
  };
  EXPECT_THAT(ask(), ElementsAre(1, 1, 1));
  EXPECT_THAT(ask(), ElementsAre(1, 0, 1));
  EXPECT_THAT(ask(), ElementsAre(1, 1, 1));
  EXPECT_EQ(segment.acts(), 1U);
}

// A frame counts once, whatever the number of its datagrams.
TEST(EthercatFrameRules, AConditionCountsFrames) {
  SegmentUnderRules segment(R"(
[[rule]]
when = { message = { message = "frame", command = "APRD" }, count = 3 }
do = "show"
object = "6041"
value = 0
)");
  for (unsigned n = 1; n <= 3; ++n) {
    segment.ask({{Command::aprd, segment.first(al_status)}, {Command::aprd, segment.first(0x0000)}});
    segment.run(1ms);
    EXPECT_EQ(segment.acts(), n == 3 ? 1U : 0U) << n;
  }
}

// A frame of another segment is none of this axis, and none of this bus.
TEST(EthercatFrameRules, AConditionCountsFramesOfItsSegment) {
  const std::string two_segments = std::string(one_slave) + R"(
bus = "ecat"
[[axis]]
name = "y"
product = "generic402-ec"
bus = "other"
[[bus]]
name = "other"
type = "ethercat"
)";
  SegmentUnderRules segment(R"(
[[rule]]
name = "of the axis"
axis = "y"
when = { message = { message = "frame" } }
do = "show"
object = "6041"
value = 0
[[rule]]
name = "of the bus"
bus = "other"
when = { message = { message = "frame" } }
do = "cable"
[[rule]]
name = "of the first"
axis = "x"
when = { message = { message = "frame" } }
do = "show"
object = "6041"
value = 0
)",
                            two_segments);
  segment.ask({{Command::brd, 0x0000}});
  segment.run(1ms);
  EXPECT_EQ(segment.acts(0), 0U);
  EXPECT_EQ(segment.acts(1), 0U);
  EXPECT_EQ(segment.acts(2), 1U);
}

TEST(EthercatFrameRules, AFrameComesLateByADrawnTime) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "delay"
ms = 1
jitter_ms = 4
)");
  std::set<Time> times;
  for (int n = 0; n < 10; ++n) {
    segment.send({{Command::brd, 0x0000}});
    const Time before = segment.line.now();
    ASSERT_THAT(segment.receive(10ms), SizeIs(1));
    const Time late = segment.line.now() - before;
    EXPECT_GE(late, 1ms);
    EXPECT_LE(late, 5ms + 100us);
    times.insert(late);
  }
  EXPECT_GT(times.size(), 5U);
}

TEST(EthercatFrameRules, ACycleCountsTooMuch) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "cycle" }
do = "working_counter"
add = 3
)");
  segment.map_memory();
  EXPECT_THAT(counters(segment.ask({{Command::brd, 0}, {Command::lrd, 0x10000}})), ElementsAre(1, 4));
}

TEST(EthercatFrameRules, AFrameThatIsWithheldReachesNoSlave) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame", command = "APWR" }
do = "withhold"
times = 1
)");
  EXPECT_THAT(segment.ask({{Command::apwr, segment.first(scratch), 2, 0x1234}}), SizeIs(0));
  EXPECT_EQ(segment.read(scratch), 0U);
  segment.write(scratch, 0x1234);
  EXPECT_EQ(segment.read(scratch), 0x1234U);
}

TEST(EthercatFrameRules, AnAnswerThatIsWithheldHasReachedTheSlaves) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame", command = "APWR" }
do = "withhold_answer"
times = 1
)");
  EXPECT_THAT(segment.ask({{Command::apwr, segment.first(scratch), 2, 0x1234}}), SizeIs(0));
  EXPECT_EQ(segment.read(scratch), 0x1234U);
}

TEST(EthercatFrameRules, AFrameThatPassesTwiceCountsTwice) {
  SegmentUnderRules segment(R"(
[[rule]]
bus = "ecat"
on = { message = "frame", command = "BRD" }
do = "twice"
skip = 1
times = 1
)",
                            three_slaves);
  EXPECT_THAT(counters(segment.ask({{Command::brd, 0}})), ElementsAre(3));
  EXPECT_THAT(counters(segment.ask({{Command::brd, 0}})), ElementsAre(6));
  EXPECT_THAT(counters(segment.ask({{Command::brd, 0}})), ElementsAre(3));
}

TEST(EthercatFrameRules, TheDataOfTheCycleBefore) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "cycle" }
do = "stale"
skip = 1
times = 2
)");
  segment.map_memory();
  std::vector<std::uint64_t> data;
  for (unsigned n = 1; n <= 4; ++n) {
    segment.write(scratch, n);
    const auto back = segment.read_mapped();
    ASSERT_THAT(counters(back), ElementsAre(1)) << "the counter is right";
    data.push_back(back[0].data);
  }
  EXPECT_THAT(data, ElementsAre(1, 1, 1, 4));
}

TEST(EthercatFrameRules, AFrameComesBackLate) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "delay"
ms = 30
times = 1
)");
  segment.send({{Command::brd, 0}});
  EXPECT_THAT(segment.receive(29ms), SizeIs(0));
  EXPECT_THAT(segment.receive(2ms), SizeIs(1));
}

// The result does not depend on the time between two frames.
TEST(EthercatFrameRules, AFrameComesBackBehindALaterOne) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "delay"
frames = 1
times = 1
)");
  segment.send({{Command::brd, 0}}, 1);
  EXPECT_THAT(segment.receive(100ms), SizeIs(0));
  segment.send({{Command::brd, 0}}, 2);
  EXPECT_EQ(segment.receive().at(0).index, 2);
  EXPECT_EQ(segment.receive().at(0).index, 1);
}

// A frame cannot come back by itself, so it comes with the next one.
TEST(EthercatFrameRules, AFrameThatIsHeldBackDoesNotOutliveItsRuleOrScenario) {
  const char* const rule = R"(
[[rule]]
name = "held"
on = { message = "frame" }
do = "delay"
frames = 9
times = 2
)";
  for (const char* way : {"remove", "finish", "take over"}) {
    SegmentUnderRules segment(rule);
    Director next(segment.line, scenario_of(""));
    segment.send({{Command::brd, 0}}, 1);
    segment.send({{Command::brd, 0}}, 2);
    EXPECT_THAT(segment.receive(10ms), SizeIs(0)) << way;
    if (way == std::string_view("remove")) segment.director.remove("held");
    if (way == std::string_view("finish")) segment.director.finish();
    if (way == std::string_view("take over")) {
      next.take_over(segment.director);
      next.begin();
    }
    segment.send({{Command::brd, 0}}, 3);
    for (const int index : {3, 1, 2}) EXPECT_EQ(segment.receive().at(0).index, index) << way;
    segment.send({{Command::brd, 0}}, 4);
    EXPECT_EQ(segment.receive().at(0).index, 4) << way;
    EXPECT_THAT(segment.receive(), SizeIs(0)) << way;
  }
}

TEST(EthercatFrameRules, AHeldFrameComesBackToItsSender) {
  for (const bool is_removed : {false, true}) {
    SegmentUnderRules segment(R"(
[[rule]]
name = "held"
on = { message = "frame" }
do = "delay"
frames = 1
times = 1
)");
    links::MemoryEthercatClient other(segment.bus(), segment.line);
    segment.send({{Command::brd, 0}}, 1);
    if (is_removed) segment.director.remove("held");
    for (const std::uint8_t index : std::initializer_list<std::uint8_t>{2, 3}) {
      SegmentUnderRules::send(other, {{Command::brd, 0}}, index);
      EXPECT_EQ(SegmentUnderRules::receive(other).at(0).index, index) << is_removed;
      EXPECT_THAT(SegmentUnderRules::receive(other), SizeIs(0)) << is_removed;
    }
    segment.send({{Command::brd, 0}}, 4);
    for (const int index : {4, 1}) EXPECT_EQ(segment.receive().at(0).index, index) << is_removed;
  }
}

TEST(EthercatFrameRules, AFrameBehindALostOneComesBackNotInThePast) {
  struct Returns final : links::EthercatObserver {
    void on_frame(std::span<const std::uint8_t>, ethercat::Segment::Encapsulation, Direction direction,
                  Time at) override {
      if (direction == Direction::out) times.push_back(at);
    }
    std::vector<Time> times;
  };
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "delay"
frames = 9
times = 1
)");
  segment.send({{Command::brd, 0}}, 1);
  segment.director.finish();
  segment.bus().disturb({.drop = 1.0});
  Returns returns;
  segment.bus().add_observer(returns);
  const Time sent = segment.line.now();
  segment.send({{Command::brd, 0}}, 2);
  segment.bus().remove_observer(returns);
  EXPECT_EQ(segment.receive().at(0).index, 1);
  EXPECT_THAT(returns.times, ElementsAre(testing::Ge(sent)));
}

TEST(EthercatFrameRules, AllFramesComeBackOneFrameLate) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "delay"
frames = 1
)");
  segment.send({{Command::brd, 0}}, 1);
  EXPECT_THAT(segment.receive(), SizeIs(0));
  for (std::uint8_t n = 2; n < 6; ++n) {
    segment.send({{Command::brd, 0}}, n);
    EXPECT_EQ(segment.receive().at(0).index, n - 1);
    EXPECT_THAT(segment.receive(), SizeIs(0));
  }
}

TEST(EthercatFrameRules, BytesOfAFrameAreChanged) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame", command = "APRD", address = 0x0130 }
do = "alter"
byte = 12
set = 8
)");
  EXPECT_EQ(segment.read(al_status), 8U);
  EXPECT_EQ(segment.slave().state(), AlState::init);
}

TEST(EthercatFrameRules, AFrameIsCut) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "truncate"
length = 13
times = 1
)");
  EXPECT_EQ(segment.ask({{Command::brd, 0}}).at(0).frame_length, 13U);
  EXPECT_EQ(segment.ask({{Command::brd, 0}}).at(0).frame_length, 16U);
}

TEST(EthercatFrameRules, AFrameIsExtended) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "extend"
data = "00 00 00"
times = 1
)");
  EXPECT_EQ(segment.ask({{Command::brd, 0}}).at(0).frame_length, 19U);
  EXPECT_THAT(segment.receive(), SizeIs(0)) << "it comes once";
}

TEST(EthercatFrameRules, AnAnswerComesTwice) {
  SegmentUnderRules segment(R"(
[[rule]]
on = { message = "frame" }
do = "repeat"
copies = 1
every = 2
skip = 1
)");
  const auto answers = [&](std::uint8_t index) {
    segment.send({{Command::brd, 0}}, index);
    std::vector<unsigned> indices;
    for (auto back = segment.receive(); !back.empty(); back = segment.receive()) indices.push_back(back[0].index);
    return indices;
  };
  EXPECT_THAT(answers(1), ElementsAre(1));
  EXPECT_THAT(answers(2), ElementsAre(2, 2));
  EXPECT_THAT(answers(3), ElementsAre(3));
  EXPECT_THAT(answers(4), ElementsAre(4, 4));
}

// The other slaves get the frame, and the slave's registers answer.
TEST(EthercatFrameRules, ProcessDataPassOneSlaveWithoutEffect) {
  SegmentUnderRules segment(R"(
[[rule]]
axis = "y"
on = { message = "cycle" }
do = "withhold"
skip = 1
times = 2
)",
                            three_slaves);
  for (std::uint16_t position = 0; position < 3; ++position) segment.map_memory(position);
  const auto mapped = [&] { return counters(segment.ask({{Command::lrd, 0x10000}, {Command::brd, 0}})); };
  EXPECT_THAT(mapped(), ElementsAre(3, 3));
  EXPECT_THAT(mapped(), ElementsAre(2, 3));
  EXPECT_THAT(mapped(), ElementsAre(2, 3));
  EXPECT_THAT(mapped(), ElementsAre(3, 3));
  EXPECT_EQ(segment.acts(), 2U);
}

TEST(EthercatFrameRules, WhatCannotBeChangedAtOneSlaveIsRefused) {
  line::Line line(line::test::settings_of(three_slaves));
  const Scenario scenario = scenario_of("[[rule]]\naxis = \"y\"\non = { message = \"cycle\" }\ndo = \"stale\"\n");
  EXPECT_THROW(Director(line, scenario), ScenarioError);
}

TEST(EthercatFrameRules, TheCableInFrontOfASlave) {
  SegmentUnderRules segment(R"(
[[rule]]
axis = "y"
when = { time_ms = 10 }
for_ms = 20
every_ms = 50
do = "cable"
connected = false
)",
                            three_slaves);
  const auto count_at = [&](Time time) {
    segment.line.run_until(time);
    return segment.ask({{Command::brd, 0}}).at(0).counter;
  };
  EXPECT_EQ(count_at(9ms), 3U);
  EXPECT_EQ(count_at(11ms), 1U);
  EXPECT_EQ(count_at(31ms), 3U);
  EXPECT_EQ(count_at(61ms), 1U);
  EXPECT_EQ(count_at(81ms), 3U);
}

}  // namespace
}  // namespace ethercat_frame_rules_test
}  // namespace servodrome::scenario::test
