// Rules on one EtherCAT slave: its states, its slave information, its mailbox and its process data.
#include <gmock/gmock.h>

#include "master/ethercat/coe_objects.hpp"
#include "master/problem_of.hpp"
#include "scenario/segment.hpp"

namespace servodrome::scenario::test {
namespace ethercat_rules_test {
namespace {

using testing::HasSubstr;

constexpr std::uint16_t al_control = 0x0120;
constexpr std::uint16_t al_status = 0x0130;
constexpr std::uint16_t al_status_code = 0x0134;
constexpr std::uint64_t acknowledge = 0x10;
constexpr std::uint64_t error = 0x10;

using master::test::problem_of;

// ---- States

TEST(EthercatStateRules, AChangeIsRefusedWithACode) {
  SegmentUnderRules segment(R"(
[[rule]]
do = "al_refuse"
to = "safe_operational"
code = 0x0024
times = 1
)");
  EXPECT_THAT(problem_of([&] { segment.operate(); }), HasSubstr("0024h"));
  EXPECT_EQ(segment.slave().state(), AlState::pre_operational);
  EXPECT_EQ(segment.acts(), 1U);
  segment.operate();
  EXPECT_EQ(segment.slave().state(), AlState::operational);
}

TEST(EthercatStateRules, AChangeIsRefusedWithoutErrorBitAndCode) {
  SegmentUnderRules segment(R"(
[[rule]]
do = "al_refuse"
to = "pre_operational"
code = 0
times = 1
)");
  EXPECT_NE(problem_of([&] { segment.scan().to_pre_operational(); }), "");
  EXPECT_EQ(segment.read(al_status), 1U);
  EXPECT_EQ(segment.read(al_status_code), 0U);
  EXPECT_EQ(segment.acts(), 1U);
}

TEST(EthercatStateRules, AnErrorThatCannotBeAcknowledged) {
  SegmentUnderRules segment(R"(
[[rule]]
name = "drop"
when = { al = "operational" }
do = "al_drop"
to = "safe_operational"
code = 0x001B
[[rule]]
when = { after = "drop" }
do = "al_refuse"
to = "safe_operational"
code = 0x001B
times = 2
)");
  segment.operate_until_rules();
  EXPECT_EQ(segment.slave().state(), AlState::safe_operational);
  const auto status_after_acknowledgement = [&] {
    segment.write(al_control, 4 | acknowledge);
    segment.run(1ms);
    return segment.read(al_status);
  };
  EXPECT_EQ(segment.read(al_status), 4 | error);
  EXPECT_EQ(status_after_acknowledgement(), 4 | error);
  EXPECT_EQ(segment.read(al_status_code), 0x001BU);
  EXPECT_EQ(status_after_acknowledgement(), 4 | error);
  EXPECT_EQ(status_after_acknowledgement(), 4U);
  EXPECT_EQ(segment.acts(1), 2U);
}

TEST(EthercatStateRules, ASlaveFallsWithACode) {
  SegmentUnderRules segment(R"(
[[rule]]
when = { al = "operational" }
do = "al_drop"
to = "pre_operational"
code = 0x0080
)");
  segment.operate_until_rules();
  EXPECT_EQ(segment.read(al_status), 2 | error);
  EXPECT_EQ(segment.read(al_status_code), 0x0080U);
}

TEST(EthercatStateRules, ASlaveFallsWithoutACode) {
  SegmentUnderRules segment(R"(
[[rule]]
when = { al = "operational" }
do = "al_drop"
to = "safe_operational"
code = 0
)");
  segment.operate_until_rules();
  EXPECT_EQ(segment.read(al_status), 4U);
  EXPECT_EQ(segment.read(al_status_code), 0U);
}

TEST(EthercatStateRules, ARefusalEndsWithItsTimesAndComesAgain) {
  SegmentUnderRules segment(R"(
[[rule]]
when = { al = "pre_operational" }
again = true
do = "al_refuse"
to = "safe_operational"
code = 0x0024
times = 1
)");
  for (unsigned n = 1; n <= 2; ++n) {
    segment.scan().to_pre_operational();
    segment.run(2ms);
    EXPECT_THAT(problem_of([&] { segment.operate(); }), HasSubstr("0024h")) << n;
    segment.run(1ms);
    EXPECT_EQ(segment.director.rules().front().phase, RulePhase::waiting);
    EXPECT_EQ(segment.acts(), n);
    segment.slaves.front()->to_init();
    segment.run(2ms);
  }
}

TEST(EthercatStateRules, AWatchdogThatNeverTrips) {
  SegmentUnderRules segment(R"(
[[rule]]
do = "watchdog"
on = false
for_ms = 100000
)");
  segment.operate().stop();
  segment.run(10s);
  EXPECT_EQ(segment.slave().state(), AlState::operational);
  segment.write(0x0420, 50);
  segment.run(10s);
  EXPECT_EQ(segment.slave().state(), AlState::operational) << "nor when the master sets its time";
  segment.director.finish();
  segment.run(10ms);
  EXPECT_EQ(segment.slave().state(), AlState::safe_operational) << "it has expired when the rule ends";
}

// ---- Slave information

TEST(EthercatSiiRules, AWordWithTheRightChecksum) {
  SegmentUnderRules segment(R"(
[[rule]]
do = "sii"
word = 4
value = 9
)");
  const auto& found = segment.scan().found();
  EXPECT_EQ(found.alias, 9) << "as if the slave had been switched on with it";
  EXPECT_TRUE(segment.x().device().ethercat_controller()->sii().loaded());
}

TEST(EthercatSiiRules, AWrongChecksum) {
  SegmentUnderRules segment(R"(
[[rule]]
do = "sii"
word = 7
value = 0x00A5
)");
  EXPECT_EQ(segment.read(0x0012), 0U) << "the alias is not loaded";
  EXPECT_THAT(problem_of([&] { segment.scan().to_pre_operational(); }), HasSubstr("0051h"));
}

TEST(EthercatSiiRules, AnotherVendor) {
  SegmentUnderRules segment(R"(
[[rule]]
do = "sii"
word = 8
value = 0x0002
)");
  EXPECT_EQ(segment.scan().found().sii.identity.vendor_id & 0xFFFFU, 2U);
}

// ---- Process data

TEST(EthercatProcessDataRules, InputsStandWithARightCounter) {
  SegmentUnderRules segment(R"(
[[rule]]
when = { al = "operational", time_ms = 3000 }
do = "stale_inputs"
)");
  master::CyclicExchange& exchange = segment.operate();
  const auto shown = [&] { return exchange.input(0, {0x6041, 0})->get<std::uint16_t>() & 0x6F; };
  const auto command = [&](std::uint16_t word) {
    exchange.output(0, {0x6040, 0})->set(word);
    segment.master.wait(50ms);
  };
  command(0x06);
  EXPECT_EQ(shown(), 0x21);
  segment.master.wait(std::max(Time{}, Time{3s} - segment.line.now()) + 5ms);
  command(0x07);
  EXPECT_EQ(segment.x().device().drive().state(), drive::PowerState::switched_on);
  EXPECT_EQ(shown(), 0x21);
  EXPECT_TRUE(exchange.inputs_are_fresh());
  EXPECT_GT(segment.acts(), 40U);
}

TEST(EthercatProcessDataRules, ALostCycleIsCounted) {
  SegmentUnderRules segment(R"(
[[rule]]
when = { al = "operational" }
on = { message = "cycle" }
do = "withhold"
every = 10
times = 3
)");
  master::CyclicExchange& exchange = segment.operate();
  segment.master.wait(100ms);
  EXPECT_EQ(exchange.statistics().lost, 3U);
  EXPECT_EQ(segment.acts(), 3U);
  EXPECT_EQ(segment.slave().state(), AlState::operational);
}

// A lost cycle adds 3 to the slave's error counter, each of the others subtracts 1.
TEST(EthercatProcessDataRules, EachTenthCycleIsBridgedWithClocks) {
  SegmentUnderRules segment(R"(
[[rule]]
when = { al = "operational" }
on = { message = "cycle" }
do = "withhold"
every = 10
)");
  segment.operate(true);
  segment.master.wait(2s);
  EXPECT_EQ(segment.slave().state(), AlState::operational);
  EXPECT_GT(segment.acts(), 150U);
}

TEST(EthercatProcessDataRules, ADeafSlaveFallsByItsWatchdog) {
  SegmentUnderRules segment(R"(
[[rule]]
axis = "y"
when = { axis = "y", al = "operational" }
on = { message = "cycle" }
do = "withhold"
)",
                            three_slaves);
  segment.operate();
  segment.master.wait(300ms);
  const auto state_of = [&](std::size_t axis) { return segment.line.axes()[axis]->device().ethercat_slave()->state(); };
  EXPECT_EQ(state_of(0), AlState::operational);
  EXPECT_EQ(state_of(1), AlState::safe_operational);
  EXPECT_EQ(state_of(2), AlState::operational);
}

// ---- Mailbox

constexpr std::uint32_t device_type = 0x00020192;

class MailboxUnderRules : public SegmentUnderRules {
 public:
  explicit MailboxUnderRules(const std::string& rules) : SegmentUnderRules(rules) {
    scan().to_pre_operational();
    coe().set_timeout(200ms);
  }
  master::CoeClient& coe() { return slaves.front()->coe(); }
  std::string read_problem(std::uint16_t index = 0x1000) {
    return problem_of([&] { coe().read<std::uint32_t>(index); });
  }
};

TEST(EthercatMailboxRules, AnAnswerIsWithheld) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_answer", object = "1000" }
do = "withhold"
times = 2
)");  // the master asks twice
  EXPECT_NE(segment.read_problem(), "");
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
}

TEST(EthercatMailboxRules, ARequestIsWithheld) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_request", object = "6081" }
do = "withhold"
times = 1
)");
  const std::int64_t before = segment.x().device().dictionary().number(0x6081);
  EXPECT_NE(problem_of([&] { segment.coe().write<std::uint32_t>(0x6081, 0, 77); }), "");
  EXPECT_EQ(segment.x().device().dictionary().number(0x6081), before);
  segment.coe().write<std::uint32_t>(0x6081, 0, 78);
  EXPECT_EQ(segment.x().device().dictionary().number(0x6081), 78);
}

TEST(EthercatMailboxRules, AnAnswerComesLate) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_answer" }
do = "delay"
ms = 150
)");
  const Time before = segment.line.now();
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
  EXPECT_GE(segment.line.now() - before, 150ms);
  EXPECT_LT(segment.line.now() - before, 170ms);
}

// The mailbox was reset while an answer was held: the next answer has its full delay.
TEST(EthercatMailboxRules, AnAnswerThatWasLostDoesNotReleaseALaterOne) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_answer" }
do = "delay"
ms = 150
)");
  segment.coe().set_timeout(50ms);  // the master asks twice
  EXPECT_NE(segment.read_problem(), "");
  segment.slaves.front()->to_init();
  segment.slaves.front()->to_pre_operational();
  segment.coe().set_timeout(500ms);
  const Time before = segment.line.now();
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
  EXPECT_GE(segment.line.now() - before, 150ms);
}

TEST(EthercatMailboxRules, ARequestIsTakenOutLate) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_request" }
do = "delay"
ms = 150
times = 1
)");
  const Time before = segment.line.now();
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
  EXPECT_GE(segment.line.now() - before, 150ms);
  const Time then = segment.line.now();
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
  EXPECT_LT(segment.line.now() - then, 20ms);
}

// A scenario that ends leaves no message behind: the mailbox would be blocked until the next Init.
TEST(EthercatMailboxRules, AMessageThatIsHeldAtTheEndOfTheScenarioPasses) {
  for (const char* message : {"sdo_answer", "sdo_request"}) {
    MailboxUnderRules segment(
        fmt::format("[[rule]]\non = {{ message = \"{}\" }}\ndo = \"delay\"\nms = 60000\n", message));
    segment.coe().set_timeout(100ms);
    EXPECT_NE(segment.read_problem(), "") << message;
    segment.director.finish();
    EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type) << message;
  }
}

TEST(EthercatMailboxRules, ARequestThatWaitsIsForgottenWithTheMailbox) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_request" }
do = "delay"
ms = 1000
times = 1
)");
  EXPECT_NE(segment.read_problem(), "");
  segment.slaves.front()->to_init();
  segment.slaves.front()->to_pre_operational();
  const Time before = segment.line.now();
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1018), 4U);
  EXPECT_LT(segment.line.now() - before, 20ms);
}

TEST(EthercatMailboxRules, AnAnswerIsRepeated) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_answer", object = "1000" }
do = "repeat"
copies = 1
times = 1
)");
  constexpr std::uint16_t channel_status = 0x080D;
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
  segment.run(2ms);
  EXPECT_NE(segment.read(channel_status, 1) & 0x08U, 0U) << "the mailbox is full again";
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1018), 4U);
  segment.run(2ms);
  EXPECT_EQ(segment.read(channel_status, 1) & 0x08U, 0U);
}

TEST(EthercatMailboxRules, AnAnswerIsChanged) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_answer", object = "1000" }
do = "alter"
byte = 12
xor = 0x01
times = 1
)");
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type ^ 0x01U);
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
}

TEST(EthercatMailboxRules, AnAnswerIsAborted) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_answer", object = "6081" }
do = "abort"
code = 0x08000022
times = 1
)");
  EXPECT_THAT(problem_of([&] { segment.coe().write<std::uint32_t>(0x6081, 0, 77); }), HasSubstr("0800 0022h"));
  EXPECT_EQ(segment.x().device().dictionary().number(0x6081), 77) << "the write before had been carried out";
}

TEST(EthercatMailboxRules, ARequestIsAborted) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_request", object = "6081" }
do = "abort"
code = 0x06010002
times = 1
)");
  const std::int64_t before = segment.x().device().dictionary().number(0x6081);
  EXPECT_THAT(problem_of([&] { segment.coe().write<std::uint32_t>(0x6081, 0, 77); }), HasSubstr("0601 0002h"));
  EXPECT_EQ(segment.x().device().dictionary().number(0x6081), before);
  segment.coe().write<std::uint32_t>(0x6081, 0, 78);
}

TEST(EthercatMailboxRules, AMailboxErrorInPlaceOfTheAnswer) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "mailbox_answer" }
do = "replace"
data = "04 00 00 00 00 10 01 00 06 00"
times = 1
)");
  EXPECT_THAT(segment.read_problem(), HasSubstr("0006h"));
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
}

// The first mail behind the request is the emergency, the second one the answer.
TEST(EthercatMailboxRules, AnEmergencyComesBeforeTheAnswer) {
  MailboxUnderRules segment(R"(
[[rule]]
on = { message = "sdo_request" }
do = "emergency"
code = 0x8130
register = 0x11
times = 1
)");
  const master::MailboxAreas& areas = segment.coe().mailbox().areas();
  const std::array<std::uint8_t, 16> upload{0x0A, 0, 0, 0, 0, 0x03, 0x00, 0x20, 0x40, 0x00, 0x10, 0x00};
  std::vector<std::uint8_t> out(areas.out.length);
  std::copy(upload.begin(), upload.end(), out.begin());
  const std::uint16_t station = segment.slaves.front()->station();
  segment.master.write(station, areas.out.start, out);
  std::vector<std::uint8_t> in(areas.in.length);
  const auto next_mail = [&] {
    segment.run(2ms);
    segment.master.read(station, areas.in.start, in);
    return in[7] >> 4;  // the CoE service
  };
  EXPECT_EQ(next_mail(), 1);
  EXPECT_EQ(ethercat::load_u16(&in[8]), 0x8130);
  EXPECT_EQ(in[10], 0x11);
  EXPECT_EQ(next_mail(), 3);
  EXPECT_EQ(segment.acts(), 1U);
}

TEST(EthercatMailboxRules, AnEmergencyComesByItself) {
  MailboxUnderRules segment(R"(
[[rule]]
when = { al = "pre_operational" }
do = "emergency"
code = 0xFF20
register = 0x81
period_ms = 5
times = 3
)");
  segment.run(20ms);
  EXPECT_EQ(segment.coe().read<std::uint32_t>(0x1000), device_type);
  const auto& emergencies = segment.coe().mailbox().emergencies();
  ASSERT_EQ(emergencies.size(), 3U);
  EXPECT_EQ(emergencies.front().code, 0xFF20);
}

}  // namespace
}  // namespace ethercat_rules_test
}  // namespace servodrome::scenario::test
