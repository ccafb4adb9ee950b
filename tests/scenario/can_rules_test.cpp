// Rules on the messages of a CANopen drive, as a master on the bus sees them.
#include "scenario/support.hpp"

namespace servodrome::scenario::test {
namespace {

using line::test::number_in;
using line::test::sdo_read;
using line::test::sdo_write;

TEST(CanRules, AnAnswerIsWithheldOnce) {
  Stage stage(R"(
[[rule]]
on = { message = "sdo_answer" }
do = "withhold"
times = 1
)");
  EXPECT_TRUE(stage.sdo(sdo_read(1, 0x1000, 0)).empty());
  EXPECT_EQ(stage.sdo(sdo_read(1, 0x1000, 0)).size(), 1U);
  EXPECT_EQ(stage.director.rules().front().acts, 1U);
}

TEST(CanRules, AnAnswerAboutOneObjectComesLate) {
  Stage stage(R"(
[[rule]]
on = { message = "sdo_answer", object = "6041" }
do = "delay"
ms = 100
)");
  EXPECT_EQ(stage.sdo(sdo_read(1, 0x1000, 0)).size(), 1U);
  EXPECT_TRUE(stage.sdo(sdo_read(1, 0x6041, 0), 99ms).empty());
  stage.run(3ms);
  EXPECT_EQ(stage.received(0x581).size(), 1U);
}

TEST(CanRules, TheThirdWriteIsAborted) {
  Stage stage(R"(
[[rule]]
on = { message = "sdo_answer", object = "6081", data = "60" }
do = "abort"
code = 0x08000022
skip = 2
times = 1
)");
  for (const unsigned n : {1U, 2U, 3U, 4U}) {
    const auto answer = stage.sdo(sdo_write(1, 0x6081, 0, n, 4));
    ASSERT_EQ(answer.size(), 1U);
    EXPECT_EQ(answer[0].data[0], n == 3 ? 0x80 : 0x60) << n;
    if (n == 3) {
      EXPECT_EQ(number_in(answer[0]), 0x08000022U);
    }
  }
  EXPECT_EQ(stage.read(0x6081), 4U) << "the write before had been carried out";
}

TEST(CanRules, ARequestThatIsAbortedIsNotCarriedOut) {
  Stage stage(R"(
[[rule]]
on = { message = "sdo_request", object = "6081" }
do = "abort"
code = 0x06010000
times = 1
)");
  const std::int64_t before = stage.x().device().dictionary().number(0x6081);
  const auto answer = stage.sdo(sdo_write(1, 0x6081, 0, 77, 4));
  ASSERT_EQ(answer.size(), 1U);
  EXPECT_EQ(answer[0].data[0], 0x80);
  EXPECT_EQ(stage.x().device().dictionary().number(0x6081), before);
}

TEST(CanRules, BytesAndLengthsAreChanged) {
  Stage stage(R"(
[[rule]]
on = { message = "sdo_answer", object = "1000" }
do = "alter"
byte = 0
xor = 0x10
times = 1
[[rule]]
when = { time_ms = 30 }
on = { message = "sdo_answer", object = "1000" }
do = "truncate"
length = 7
times = 1
[[rule]]
when = { time_ms = 60 }
on = { message = "sdo_answer", object = "1000" }
do = "alter"
id = 0x582
times = 1
)");
  EXPECT_EQ(stage.sdo(sdo_read(1, 0x1000, 0), 30ms).at(0).data[0], 0x43 ^ 0x10);
  EXPECT_EQ(stage.sdo(sdo_read(1, 0x1000, 0), 30ms).at(0).length, 7);
  EXPECT_EQ(stage.answers(sdo_read(1, 0x1000, 0), 0x582).size(), 1U);
}

TEST(CanRules, AHeartbeatStopsWhileTheDriveIsEnabled) {
  Stage stage(R"(
[[rule]]
when = { state = "operation_enabled" }
until = { state = "switch_on_disabled" }
again = true
on = { message = "heartbeat" }
do = "withhold"
)");
  stage.write(0x1017, 10, 2);
  stage.received(0x701);
  stage.run(100ms);
  EXPECT_GE(stage.received(0x701).size(), 9U);
  for (int n = 0; n < 2; ++n) {
    stage.enable();
    stage.received(0x701);
    stage.run(100ms);
    EXPECT_TRUE(stage.received(0x701).empty()) << n;
    stage.write(0x6040, 0, 2);
    stage.run(200ms);
    EXPECT_FALSE(stage.received(0x701).empty()) << n;
  }
}

TEST(CanRules, TheBootUpComesTwice) {
  Stage stage(R"(
[[rule]]
on = { message = "boot_up" }
do = "repeat"
copies = 1
gap_ms = 5
)");
  stage.run(2s);
  EXPECT_EQ(stage.received(0x701).size(), 2U) << "a rule acts on the first frame of a new line";
  EXPECT_EQ(stage.answers(line::test::nmt(0x81, 1), 0x701, 2s).size(), 2U);
}

TEST(CanRules, ANodeIgnoresCommandsOfTheNetworkManagement) {
  Stage stage(R"(
[[rule]]
on = { message = "nmt", data = "01" }
do = "withhold"
)");
  stage.run(10ms);
  stage.send(line::test::nmt(1, 1));
  stage.run(10ms);
  EXPECT_EQ(stage.x().device().can_node()->nmt_state(), canopen::NmtState::pre_operational);
}

TEST(CanRules, AnEmergencyStorm) {
  Stage stage(R"(
[[rule]]
when = { time_ms = 10 }
bus = "can0"
do = "send"
id = 0x81
data = "10 43 09 00 00 00 00 00"
period_ms = 0.5
times = 100
)");
  stage.run(200ms);
  EXPECT_EQ(stage.received(0x81).size(), 100U);
}

// A rule that begins again does not continue the messages of its earlier runs.
TEST(CanRules, ARuleThatBeginsAgainSendsOnce) {
  constexpr const char* periodic = "for_ms = 95\nevery_ms = 100\n";
  constexpr const char* again = "for_ms = 95\nwhen = { powered = true }\nagain = true\n";
  constexpr const char* send =
      "bus = \"can0\"\ndo = \"send\"\nid = 0x123\ndata = \"01\"\nperiod_ms = 110\ntimes = 1000\n";
  constexpr const char* emergency = "do = \"emergency\"\ncode = 0x1000\nperiod_ms = 110\ntimes = 1000\n";
  for (const char* action : {send, emergency}) {
    Stage stage(fmt::format("[[rule]]\n{}{}", periodic, action));
    stage.run(1s - 1ms);
    EXPECT_EQ(stage.director.rules().front().acts, 10U) << action;
  }
  Stage stage(fmt::format("[[rule]]\naxis = \"x\"\n{}{}", again, emergency));
  for (int n = 0; n < 5; ++n) {
    stage.run(100ms);
    stage.x().power_off(stage.line.now());
    stage.run(1ms);
    stage.x().power_on(stage.line.now());
  }
  EXPECT_EQ(stage.director.rules().front().acts, 5U);
}

TEST(CanRules, AFrameThatIsLateAtTheEndOfTheScenarioPasses) {
  Stage stage("[[rule]]\non = { message = \"sdo_answer\" }\ndo = \"delay\"\nms = 60000\n");
  EXPECT_TRUE(stage.sdo(sdo_read(1, 0x1000, 0)).empty());
  stage.director.finish();
  stage.run(1ms);
  EXPECT_EQ(stage.received(0x581).size(), 1U);
}

TEST(CanRules, AFrameThatIsLateIsLostWithThePower) {
  Stage stage("[[rule]]\non = { message = \"sdo_answer\" }\ndo = \"delay\"\nms = 50\n");
  EXPECT_TRUE(stage.sdo(sdo_read(1, 0x1000, 0)).empty());
  stage.x().power_off(stage.line.now());
  stage.run(1ms);
  stage.x().power_on(stage.line.now());
  stage.run(200ms);
  EXPECT_TRUE(stage.received(0x581).empty());
}

TEST(CanRules, AFrameThatIsLateIsLostWithAReset) {
  Stage stage("[[rule]]\non = { message = \"sdo_answer\" }\ndo = \"delay\"\nms = 50\n");
  EXPECT_TRUE(stage.sdo(sdo_read(1, 0x1000, 0)).empty());
  stage.send(line::test::nmt(0x82, 1));
  stage.run(200ms);
  EXPECT_TRUE(stage.received(0x581).empty());
}

TEST(CanRules, ABootUpIsLateAlsoAfterAReset) {
  Stage stage("[[rule]]\non = { message = \"boot_up\" }\ndo = \"delay\"\nms = 50\n");
  stage.run(2s);
  EXPECT_EQ(stage.received(0x701).size(), 1U);
  stage.send(line::test::nmt(0x81, 1));
  stage.run(45ms);
  EXPECT_TRUE(stage.received(0x701).empty());
  stage.run(2s);
  EXPECT_EQ(stage.received(0x701).size(), 1U);
}

TEST(CanRules, ADriveWithoutPowerSaysNothing) {
  Stage stage(R"(
[[rule]]
on = { message = "sdo_answer" }
do = "delay"
ms = 50
[[rule]]
when = { time_ms = 30 }
do = "power"
on = false
)");
  EXPECT_TRUE(stage.sdo(sdo_read(1, 0x1000, 0), 100ms).empty());
  EXPECT_FALSE(stage.x().powered());
  stage.director.finish();
  EXPECT_TRUE(stage.x().powered()) << "the rule takes its effect back when it ends";
}

TEST(CanRules, BusOffAndRecovery) {
  Stage stage(R"(
[[rule]]
when = { time_ms = 10 }
for_ms = 1
do = "error_state"
state = "bus_off"
)");
  stage.run(11ms - 62500ns);
  EXPECT_EQ(stage.error_state(), links::ErrorState::bus_off);
  stage.run(100ms);
  EXPECT_EQ(stage.error_state(), links::ErrorState::active);
  EXPECT_EQ(stage.sdo(sdo_read(1, 0x1000, 0)).size(), 1U);
}

// Successful frames lower the error counters, and a controller recovers from bus-off; under a rule it does neither.
TEST(CanRules, AnErrorStateLastsAsLongAsItsRule) {
  for (const auto& [word, state] : std::vector<std::pair<std::string, links::ErrorState>>{
           {"passive", links::ErrorState::passive}, {"bus_off", links::ErrorState::bus_off}}) {
    Stage stage("[[rule]]\nwhen = { time_ms = 10 }\nfor_ms = 500\ndo = \"error_state\"\nstate = \"" + word + "\"\n");
    stage.run(20ms);
    for (int n = 0; n < 5; ++n) {
      EXPECT_EQ(stage.sdo(sdo_read(1, 0x1000, 0)).size(), word == "passive" ? 1U : 0U);
    }
    stage.x().power_off(stage.line.now());
    stage.x().power_on(stage.line.now());
    stage.run(100ms);
    EXPECT_EQ(stage.error_state(), state) << word;
    stage.run(500ms);
    EXPECT_EQ(stage.error_state(), links::ErrorState::active) << word;
  }
}

TEST(CanRules, TwoErrorStatesEndOneAfterTheOther) {
  Stage stage(R"(
[[rule]]
when = { time_ms = 10 }
for_ms = 100
do = "error_state"
state = "passive"
[[rule]]
when = { time_ms = 20 }
for_ms = 200
do = "error_state"
state = "bus_off"
)");
  stage.run(15ms);
  EXPECT_EQ(stage.error_state(), links::ErrorState::passive);
  stage.run(135ms);
  EXPECT_EQ(stage.error_state(), links::ErrorState::bus_off) << "the first rule has ended, the second has not";
  stage.run(200ms);
  EXPECT_EQ(stage.error_state(), links::ErrorState::active);
}

// A drive that has no acknowledge becomes error passive by itself, and error active by the frames after that.
TEST(CanRules, AnErrorStateOfTheDriveItselfDoesNotStayAfterARule) {
  Stage stage("[[rule]]\nwhen = { time_ms = 300 }\nfor_ms = 100\ndo = \"error_state\"\nstate = \"passive\"\n");
  links::CanBus& bus = stage.line.buses().front()->bus;
  stage.write(0x1017, 10, 2);
  bus.cut_bus(true);
  stage.run(200ms);
  ASSERT_EQ(stage.error_state(), links::ErrorState::passive);
  stage.run(250ms);
  EXPECT_EQ(stage.director.rules().front().phase, RulePhase::over);
  bus.cut_bus(false);
  stage.run(100ms);
  EXPECT_EQ(stage.error_state(), links::ErrorState::active);
}

// The controller has gone to bus-off by itself when the rule ends.
TEST(CanRules, AForcedErrorStateEndsAlsoInAWorseOne) {
  Stage stage("[[rule]]\nwhen = { time_ms = 100 }\nfor_ms = 200\ndo = \"error_state\"\nstate = \"passive\"\n");
  links::CanBus& bus = stage.line.buses().front()->bus;
  stage.write(0x1017, 10, 2);
  stage.run(150ms);
  bus.set_automatic_recovery(stage.x().port(), false);
  bus.disturb({.corrupt = 1.0});
  stage.run(100ms);
  ASSERT_EQ(stage.error_state(), links::ErrorState::bus_off);
  bus.clear_disturbance();
  stage.run(100ms);
  EXPECT_EQ(stage.director.rules().front().phase, RulePhase::over);
  EXPECT_EQ(stage.error_state(), links::ErrorState::active);
}

// ---- The number of acts

TEST(CanRules, ARuleThatSendsEndsWithItsLastFrame) {
  Stage stage(R"(
[[rule]]
name = "frames"
bus = "can0"
when = { axis = "x", powered = false }
again = true
do = "send"
id = 0x123
times = 2
[[rule]]
name = "emergency"
when = { powered = false }
again = true
do = "emergency"
code = 0x1000
)");
  for (unsigned n = 1; n <= 3; ++n) {
    stage.x().power_off(stage.line.now());
    stage.run(10ms);
    stage.x().power_on(stage.line.now());
    stage.run(10ms);
    EXPECT_EQ(stage.director.rules()[0].acts, 2 * n);
    EXPECT_EQ(stage.director.rules()[1].acts, n);
    EXPECT_EQ(stage.director.rules()[0].phase, RulePhase::waiting);
  }
  EXPECT_EQ(stage.received(0x123).size(), 6U);
}

constexpr std::string_view slow_bus = R"(
clock = "virtual"
[[bus]]
name = "can0"
bit_rate = 125000
[[axis]]
name = "x"
product = "generic402"
node = 1
)";

TEST(CanRules, BabbleEndsAfterItsTimes) {
  Stage stage("[[rule]]\nbus = \"can0\"\ndo = \"babble\"\nid = 1\ntimes = 5\n");
  stage.run(100ms);
  EXPECT_EQ(stage.received(1).size(), 5U);
  EXPECT_EQ(stage.director.rules().front().phase, RulePhase::over);
}

// The bus is slower than the rule; nothing piles up.
TEST(CanRules, NoFrameIsSentAfterTheEndOfItsRule) {
  for (const char* action : {"do = \"babble\"\n", "do = \"send\"\nperiod_ms = 0.05\ntimes = 1000000\n"}) {
    Stage stage(fmt::format("[[rule]]\nbus = \"can0\"\n{}id = 1\nfor_ms = 100\n", action), slow_bus);
    stage.run(90ms);
    EXPECT_GT(stage.received(1).size(), 180U) << "the rule fills the bus";
    stage.run(11ms);
    stage.received(1);
    stage.run(100ms);
    EXPECT_TRUE(stage.received(1).empty()) << action;
  }
}

TEST(CanRules, ASlowBusCarriesAllFramesOfARule) {
  Stage stage("[[rule]]\nbus = \"can0\"\ndo = \"send\"\nid = 1\nperiod_ms = 0.05\ntimes = 400\n", slow_bus);
  stage.run(1s);
  EXPECT_EQ(stage.received(1).size(), 400U);
  EXPECT_EQ(stage.director.rules().front().acts, 400U);
}

// ---- Draws

// The same scenario and the same traffic give the same frames at the same nanoseconds.
TEST(CanRules, DrawsAreRepeated) {
  const auto run = [] {
    Stage stage(R"(
seed = 7
[[rule]]
on = { message = "sdo_answer" }
do = "delay"
ms = 1
jitter_ms = 5
chance = 0.5
[[rule]]
on = { message = "sdo_answer" }
do = "withhold"
chance = 0.2
)");
    line::test::Recorder recorder(stage.line.buses().front()->bus);
    for (int n = 0; n < 200; ++n) {
      stage.send(sdo_read(1, 0x6041, 0));
      stage.run(10ms);
    }
    return std::pair(recorder.text(), stage.director.rules().at(1).acts);
  };
  const auto first = run();
  EXPECT_EQ(first, run());
  EXPECT_GT(first.second, 15U);
  EXPECT_LT(first.second, 70U);
}

TEST(CanRules, AnotherRuleDoesNotChangeTheDraws) {
  const std::string drawing = R"(
[[rule]]
name = "drawing"
on = { message = "sdo_answer" }
do = "delay"
ms = 1
jitter_ms = 5
chance = 0.5
)";
  const std::string other = "[[rule]]\nname = \"other\"\ndo = \"show\"\nobject = \"6078\"\nvalue = 3\n";
  const auto run = [](const std::string& rules) {
    Stage stage("seed = 7\n" + rules);
    line::test::Recorder recorder(stage.line.buses().front()->bus);
    for (int n = 0; n < 50; ++n) {
      stage.send(sdo_read(1, 0x6041, 0));
      stage.run(10ms);
    }
    return recorder.text();
  };
  const std::string alone = run(drawing);
  EXPECT_EQ(run(other + drawing), alone);
  EXPECT_EQ(run(drawing + other), alone);
  std::string renamed = drawing;
  renamed.replace(renamed.find("drawing"), 7, "another");
  EXPECT_NE(run(renamed), alone);
}

}  // namespace
}  // namespace servodrome::scenario::test
