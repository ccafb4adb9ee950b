// Rules on the messages of RS485 lines, as a master on the line receives them.
#include <gmock/gmock.h>

#include "scenario/serial_support.hpp"

namespace servodrome::scenario::test {
namespace serial_rules_test {
namespace {

using serial10::Command;

const std::string read_status = rtu("01 03 01 00 00 01");
const std::string status = rtu("01 03 02 02 50");
const std::string write_mode = rtu("01 06 00 01 00 03");  // 6060h = 3; the answer is the same

// The characters that the master receives after a request, with one rule on answers.
std::string answer_with(const std::string& rule) {
  SerialScene scene("[[rule]]\non = { message = \"answer\" }\n" + rule);
  return scene.ask(read_status);
}

TEST(SerialRules, WithoutRulesNothingChanges) { EXPECT_EQ(SerialScene("").ask(read_status), status); }

TEST(SerialRules, AnAnswerIsWithheldOnce) {
  SerialScene scene(R"(
[[rule]]
on = { message = "answer", function = 3 }
do = "withhold"
times = 1
)");
  EXPECT_EQ(scene.ask(write_mode), write_mode) << "another function";
  EXPECT_EQ(scene.ask(read_status), "");
  EXPECT_EQ(scene.ask(read_status), status);
  EXPECT_EQ(scene.acts(), 1U);
}

TEST(SerialRules, AnAnswerIsLate) {
  SerialScene scene(R"(
[[rule]]
on = { message = "answer" }
do = "delay"
ms = 200
times = 1
)");
  EXPECT_EQ(scene.ask(read_status, 200ms), "");
  EXPECT_EQ(scene.heard(20ms), status);
  EXPECT_EQ(scene.ask(read_status), status);
}

TEST(SerialRules, AnAnswerIsAlteredWithAndWithoutANewChecksum) {
  EXPECT_EQ(answer_with("do = \"alter\"\nbyte = 0\nset = 2\n"), "02" + status.substr(2));
  EXPECT_EQ(answer_with("do = \"alter\"\nbyte = 0\nset = 2\nchecksum = true\n"), rtu("02 03 02 02 50"));
  EXPECT_EQ(answer_with("do = \"alter\"\nbytes = \"?? 04\"\nchecksum = true\n"), rtu("01 04 02 02 50"));
  EXPECT_EQ(answer_with("do = \"alter\"\nbyte = 3\nswap = 4\nchecksum = true\n"), rtu("01 03 02 50 02"));
  const std::string damaged = answer_with("do = \"alter\"\nbyte = -1\nxor = 0xFF\n");
  EXPECT_EQ(damaged.substr(0, 18), status.substr(0, 18));
  EXPECT_NE(damaged.substr(18), status.substr(18));
}

TEST(SerialRules, TheLengthOfACutAnswerCountsTheBytesBeforeTheChecksum) {
  EXPECT_EQ(answer_with("do = \"truncate\"\nlength = 4\n"), status.substr(0, 11));
  EXPECT_EQ(answer_with("do = \"truncate\"\nlength = 4\nchecksum = true\n"), rtu("01 03 02 02"));
}

TEST(SerialRules, AnAnswerIsExtended) {
  EXPECT_EQ(answer_with("do = \"extend\"\ndata = \"00 00\"\n"), status + " 00 00");
  EXPECT_EQ(answer_with("do = \"extend\"\ndata = \"AA\"\nchecksum = true\n"), rtu("01 03 02 02 50 AA"));
  EXPECT_EQ(answer_with("do = \"extend\"\ndata = \"FF 5A\"\nbefore = true\n"), "FF 5A " + status);
}

TEST(SerialRules, AFrameOfAnotherStationComesBeforeTheAnswer) {
  SerialScene scene(R"(
[[rule]]
on = { message = "answer" }
do = "extend"
data = "02 03 02 06 37 BE 32"
before = true
gap_ms = 5
)");
  scene.master.send(bytes_of(read_status));
  const Time first = scene.time_of(7);
  EXPECT_EQ(scene.time_of(7), 5ms + 7 * scene.character());
  EXPECT_LT(first, 20ms);
  EXPECT_EQ(scene.ask(read_status), "02 03 02 06 37 BE 32 " + status);
}

TEST(SerialRules, AnAnswerComesThreeTimes) {
  SerialScene scene(R"(
[[rule]]
on = { message = "answer" }
do = "repeat"
copies = 2
gap_ms = 5
times = 1
)");
  scene.master.send(bytes_of(read_status));
  scene.time_of(7);
  EXPECT_EQ(scene.time_of(14), 2 * (5ms + 7 * scene.character()));
  EXPECT_EQ(scene.ask(read_status), status);
}

TEST(SerialRules, AnAnswerIsReplaced) {
  EXPECT_EQ(answer_with("do = \"replace\"\ndata = \"01 02 03\"\n"), "01 02 03");
  EXPECT_EQ(answer_with("do = \"replace\"\ndata = \"01 02 03\"\nchecksum = true\n"), rtu("01 02 03"));
}

TEST(SerialRules, TheCharactersOfAnAnswerComeSlowly) {
  SerialScene scene(R"(
[[rule]]
on = { message = "answer" }
do = "slow"
gap_ms = 8
)");
  scene.master.send(bytes_of(read_status));
  scene.time_of(1);
  EXPECT_EQ(scene.time_of(6), 6 * (8ms + scene.character()));
}

TEST(SerialRules, AnAnswerThatIsAbortedHasBeenCarriedOut) {
  SerialScene scene(R"(
[[rule]]
on = { message = "answer" }
do = "abort"
code = 4
times = 1
)");
  EXPECT_EQ(scene.ask(write_mode), rtu("01 86 04"));
  EXPECT_EQ(scene.object(0x6060), 3);
  EXPECT_EQ(scene.ask(read_status), status);
}

TEST(SerialRules, ARequestThatIsAbortedIsNotCarriedOut) {
  SerialScene scene(R"(
[[rule]]
on = { message = "request", function = 6 }
do = "abort"
code = 2
times = 1
)");
  EXPECT_EQ(scene.ask(write_mode, 15ms), rtu("01 86 02"));
  EXPECT_NE(scene.object(0x6060), 3);
  EXPECT_EQ(scene.ask(write_mode), write_mode) << "the drive understands the next request at once";
  EXPECT_EQ(scene.object(0x6060), 3);
}

TEST(SerialRules, ARefusalIsAnAnswerForOtherRules) {
  SerialScene scene(R"(
[[rule]]
on = { message = "request", function = 6 }
do = "abort"
code = 4
[[rule]]
on = { message = "answer", data = "?? 86" }
do = "alter"
byte = 1
set = 0x83
checksum = true
)");
  EXPECT_EQ(scene.ask(write_mode), rtu("01 83 04"));
  EXPECT_EQ(scene.acts(1), 1U);
}

TEST(SerialRules, ARequestIsLost) {
  SerialScene scene(R"(
[[rule]]
on = { message = "request", data = "?? 06" }
do = "withhold"
skip = 1
times = 1
)");
  EXPECT_EQ(scene.ask(write_mode), write_mode);
  const std::string back = rtu("01 06 00 01 00 01");
  EXPECT_EQ(scene.ask(back, 10ms), "");
  EXPECT_EQ(scene.object(0x6060), 3);
  EXPECT_EQ(scene.ask(back), back);
}

// The characters begin with the answer, and each sender garbles the other's.
TEST(SerialRules, ASecondStationAnswersAtTheSameTime) {
  SerialScene scene(R"(
[[rule]]
bus = "rs"
on = { message = "answer" }
do = "send"
data = "00 00 00 00 00 00 00 00"
times = 1
)");
  scene.ask(read_status);
  EXPECT_EQ(scene.bus.line.counters().collisions, 14U);
  EXPECT_EQ(scene.acts(), 1U);
  EXPECT_EQ(scene.ask(read_status), status);
}

// The drive also receives these characters: they follow its frame without a pause, so it discards the request.
TEST(SerialRules, CharactersDirectlyBehindARequestSpoilIt) {
  SerialScene scene(R"(
[[rule]]
bus = "rs"
on = { message = "request" }
do = "send"
data = "FF 00"
times = 1
)");
  scene.master.send(bytes_of(read_status));
  EXPECT_EQ(scene.time_of(2), 10 * scene.character());
  EXPECT_EQ(scene.heard(100ms), "");
  EXPECT_EQ(scene.ask(read_status), status);
}

TEST(SerialRules, CharactersInTheMiddleOfARequestGarbleIt) {
  SerialScene scene(R"(
[[rule]]
bus = "rs"
when = { time_ms = 102 }
do = "send"
data = "FF"
)");
  scene.line.run_until(100ms);
  EXPECT_EQ(scene.ask(read_status, 50ms).size(), 2U) << "only the character of the rule";
  EXPECT_GT(scene.bus.line.counters().collisions, 1U);
  EXPECT_EQ(scene.ask(read_status), status);
}

TEST(SerialRules, NoiseFillsTheLineWithoutAPause) {
  SerialScene scene(R"(
[[rule]]
bus = "rs"
when = { time_ms = 100 }
do = "send"
data = "00 FF 00 FF"
period_ms = 1
times = 20
)");
  scene.line.run_until(100ms - 62500ns);
  EXPECT_EQ(scene.time_of(80), 62500ns + 80 * scene.character());
  EXPECT_EQ(scene.heard(100ms), "");
  EXPECT_EQ(scene.acts(), 20U);
  EXPECT_EQ(scene.ask(read_status), status);
}

TEST(SerialRules, CharactersThatARuleHasBegunToSendAreSentInPlaceOfAnotherScenario) {
  SerialScene scene(R"(
[[rule]]
bus = "rs"
when = { time_ms = 100 }
do = "send"
data = "01 02 03 04 05 06 07 08 09 0A 0B 0C"
)");
  scene.line.run_until(100ms + 3 * scene.character());
  Director next(scene.line, scenario_of(""));
  next.take_over(scene.director);
  next.begin();
  EXPECT_EQ(scene.heard(100ms), hex_of(bytes_of("01 02 03 04 05 06 07 08 09 0A 0B 0C")));
}

TEST(SerialRules, AStubIsCutAndTheOtherDriveAnswers) {
  SerialScene scene(R"(
[[rule]]
axis = "x"
when = { time_ms = 100 }
for_ms = 200
do = "cable"
connected = false
)",
                    two_rtu_axes);
  const std::string to_y = rtu("02 03 01 00 00 01");
  const std::string y = rtu("02 03 02 02 50");
  scene.line.run_until(110ms);
  EXPECT_EQ(scene.ask(read_status, 50ms), "");
  EXPECT_EQ(scene.ask(write_mode, 50ms), "");
  EXPECT_EQ(scene.ask(to_y, 50ms), y);
  EXPECT_NE(scene.object(0x6060), 3) << "x has not heard the write";
  scene.line.run_until(310ms);
  EXPECT_EQ(scene.ask(read_status, 50ms), status);
}

TEST(SerialRules, AStubThatIsCutInTheMiddleOfAnAnswer) {
  SerialScene scene(R"(
[[rule]]
when = { time_ms = 100 }
do = "cable"
connected = false
)");
  scene.line.run_until(91ms);  // the answer begins 11.5 characters later and lasts 7
  EXPECT_EQ(scene.ask(read_status), status.substr(0, 11)) << "four characters have ended at 100 ms";
}

TEST(SerialRules, ARuleOfABusLeavesOtherBusesAlone) {
  SerialScene scene(R"(
[[rule]]
bus = "other"
on = { message = "answer" }
do = "withhold"
)",
                    std::string(one_rtu_axis) + "[[bus]]\nname = \"other\"\ntype = \"rs485\"\n");
  EXPECT_EQ(scene.ask(read_status), status);
  EXPECT_EQ(scene.acts(), 0U);
}

TEST(SerialRules, ObjectsAreShownAndWritesIgnoredInRegisters) {
  SerialScene scene(R"(
[[rule]]
do = "show"
object = "6041"
value = 0x1234
[[rule]]
do = "ignore"
object = "6060"
)");
  EXPECT_EQ(scene.ask(read_status), rtu("01 03 02 12 34"));
  EXPECT_EQ(scene.ask(write_mode), write_mode);
  EXPECT_NE(scene.object(0x6060), 3);
  EXPECT_EQ(scene.acts(1), 1U);
  EXPECT_NE(scene.object(0x6041), 0x1234) << "the drive itself is not changed";
}

TEST(SerialRules, WhatARequestCannotDoIsRefused) {
  for (const std::string wrong :
       {"on = { message = \"request\" }\ndo = \"delay\"\nms = 1\n",
        "on = { message = \"request\" }\ndo = \"slow\"\ngap_ms = 1\n",
        "on = { message = \"request\" }\ndo = \"alter\"\nbyte = 1\nset = 1\nchecksum = true\n"}) {
    EXPECT_THROW(SerialScene("[[rule]]\n" + wrong), ScenarioError) << wrong;
  }
}

TEST(SerialRules, ASenderWithoutCharactersIsRefused) {
  for (const std::string action : {"babble", "send"}) {
    EXPECT_THROW(SerialScene("[[rule]]\nbus = \"rs\"\ndo = \"" + action + "\"\n"), ScenarioError) << action;
  }
}

// ---- The 10-byte protocol

const std::string ask_mode = serial10_frame(Command::read, 0x6060);
const std::string set_mode = serial10_frame(Command::write_1, 0x6060, 3);
const std::string mode_is_set = serial10_frame(Command::written, 0x6060, 3);

std::string serial10_answer_with(const std::string& rule) {
  SerialScene scene("[[rule]]\non = { message = \"answer\", object = \"6060\" }\n" + rule, one_serial10_axis);
  EXPECT_EQ(scene.ask(serial10_frame(Command::read, 0x1000)).size(), 29U) << "another object";
  return scene.ask(set_mode);
}

TEST(Serial10Rules, AnswersAreChanged) {
  EXPECT_EQ(serial10_answer_with("do = \"withhold\"\n"), "");
  EXPECT_EQ(serial10_answer_with("do = \"alter\"\nbyte = 0\nset = 2\nchecksum = true\n"),
            serial10_frame(Command::written, 0x6060, 3, 2));
  EXPECT_EQ(serial10_answer_with("do = \"alter\"\nbyte = 0\nset = 2\n"), "02" + mode_is_set.substr(2));
  EXPECT_EQ(serial10_answer_with("do = \"truncate\"\nlength = 5\n"), mode_is_set.substr(0, 14));
  EXPECT_EQ(serial10_answer_with("do = \"truncate\"\nlength = 2\nchecksum = true\n"), "01 60 9F");
  EXPECT_EQ(serial10_answer_with("do = \"extend\"\ndata = \"5A\"\nbefore = true\n"), "5A " + mode_is_set);
  EXPECT_EQ(serial10_answer_with("do = \"repeat\"\ngap_ms = 5\n"), mode_is_set + " " + mode_is_set);
}

TEST(Serial10Rules, AnAnswerThatIsAbortedHasBeenCarriedOut) {
  SerialScene scene(R"(
[[rule]]
on = { message = "answer", object = "6060" }
do = "abort"
code = 0x06020000
)",
                    one_serial10_axis);
  EXPECT_EQ(scene.ask(set_mode), serial10_frame(Command::error, 0x6060, 0x06020000));
  EXPECT_EQ(scene.object(0x6060), 3);
}

TEST(Serial10Rules, ARequestThatIsAbortedIsNotCarriedOut) {
  SerialScene scene(R"(
[[rule]]
on = { message = "request", object = "6060", data = "?? 2F" }
do = "abort"
code = 0x08000022
times = 1
)",
                    one_serial10_axis);
  const std::int64_t before = scene.object(0x6060);
  EXPECT_EQ(scene.ask(set_mode, 5ms), serial10_frame(Command::error, 0x6060, 0x08000022));
  EXPECT_EQ(scene.object(0x6060), before);
  EXPECT_EQ(scene.ask(set_mode, 5ms), mode_is_set) << "the drive understands the next request at once";
  EXPECT_EQ(scene.object(0x6060), 3);
}

TEST(Serial10Rules, TwoDrivesAnswerTheUniversalId) {
  SerialScene scene(R"(
[[rule]]
bus = "rs"
on = { message = "request", data = "7F" }
do = "send"
data = "02 60 60 60 00 03 00 00 00 DB"
)",
                    one_serial10_axis);
  EXPECT_EQ(scene.ask(set_mode), mode_is_set);
  const std::uint64_t before = scene.bus.line.counters().collisions;
  scene.ask(serial10_frame(Command::write_1, 0x6060, 3, serial10::universal_id));
  EXPECT_EQ(scene.bus.line.counters().collisions - before, 20U);
}

TEST(Serial10Rules, AWriteIsIgnored) {
  SerialScene scene("[[rule]]\ndo = \"ignore\"\nobject = \"6060\"\n", one_serial10_axis);
  const std::int64_t before = scene.object(0x6060);
  EXPECT_EQ(scene.ask(set_mode), mode_is_set);
  EXPECT_EQ(scene.object(0x6060), before);
  EXPECT_EQ(scene.acts(), 1U);
}

}  // namespace
}  // namespace serial_rules_test
}  // namespace servodrome::scenario::test
