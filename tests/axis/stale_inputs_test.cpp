// An EtherCAT slave whose inputs keep their values, with a right working counter.
#include <gmock/gmock.h>

#include "axis/quick_motions.hpp"
#include "ethercat/slave/slave.hpp"

namespace servodrome::master::test {
namespace stale_inputs_test {
namespace {

using namespace quick_motions;
using testing::HasSubstr;

struct Hang final : ethercat::SlaveInterposer {
  bool keeps_inputs(Time) override { return hangs; }
  Receipt receives(std::span<std::uint8_t>) override { return reads_no_mail ? Receipt::discard : Receipt::serve; }
  Dispatch sends(Mail&) override {
    if (answers_to_lose == 0) return {};
    --answers_to_lose;
    return {Sending::withhold};
  }

  bool hangs = false;
  bool reads_no_mail = false;
  unsigned answers_to_lose = 0;
};

class StaleInputs : public testing::Test {
 protected:
  StaleInputs() { rig.drive().device().ethercat_slave()->interpose(&hang); }
  ~StaleInputs() override { rig.drive().device().ethercat_slave()->interpose(nullptr); }

  AxisRig rig{{"generic402-ec", RigCase::BusKind::ethercat}};
  Hang hang;
  Axis402 axis{rig.objects(), rig.options()};
  EthercatSlave& slave = *rig.slaves[0];
};

TEST_F(StaleInputs, EndAMotionAndLeaveTheAxisDisabled) {
  axis.enable();
  const Time begun = rig.objects().now();
  const std::string problem =
      problem_of([&] { axis.home(to_index, 60s, [&](const AxisStatus&) { hang.hangs = true; }); });
  EXPECT_THAT(problem, HasSubstr("the inputs have not changed for 0.5 s"));
  EXPECT_LT(rig.objects().now() - begun, 4s);
  EXPECT_EQ(axis.try_to_switch_off(), "");
  EXPECT_EQ(state_of(slave.coe().read<std::uint16_t>(0x6041)), PowerState::switch_on_disabled);
}

TEST_F(StaleInputs, AndAMailboxWithoutAnswersEndAMotion) {
  axis.enable();
  const Time begun = rig.objects().now();
  const std::string problem =
      problem_of([&] { axis.home(to_index, 60s, [&](const AxisStatus&) { hang.hangs = hang.reads_no_mail = true; }); });
  EXPECT_THAT(problem, HasSubstr("the inputs have not changed for 0.5 s, and "));
  EXPECT_LT(rig.objects().now() - begun, 6s);
  EXPECT_NE(axis.try_to_switch_off(), "");
  EXPECT_LT(rig.objects().now() - begun, 20s);
  hang.reads_no_mail = false;
  EXPECT_EQ(state_of(slave.coe().read<std::uint16_t>(0x6041)), PowerState::switch_on_disabled);
}

// A reader may have caught the first error, and the motion goes on.
TEST_F(StaleInputs, AndAMailboxWithoutAnswersAreReportedAgain) {
  axis.enable();
  axis.run_at(2 * revolution, {{}, 100 * revolution, 100 * revolution}, 5s);
  hang.hangs = hang.reads_no_mail = true;
  for (int i = 0; i < 3; ++i) {
    const Time begun = rig.objects().now();
    EXPECT_THAT(problem_of([&] { axis.hold_for(10s); }), HasSubstr("the inputs have not changed for 0.5 s, and "));
    EXPECT_LT(rig.objects().now() - begun, 4s);
  }
}

TEST_F(StaleInputs, AndAMailboxWithoutAnswersDoNotKeepAStopFromTheDrive) {
  for (const Time later : {0s, 2s}) {
    axis.enable();
    axis.run_at(2 * revolution, {{}, 100 * revolution, 100 * revolution}, 5s);
    hang.hangs = hang.reads_no_mail = true;
    EXPECT_NE(problem_of([&] { axis.hold_for(10s); }), "");
    rig.objects().wait(later);
    axis.try_to_stop();
    rig.objects().wait(500ms);
    EXPECT_NEAR(rig.drive().plant().velocity_rpm(), 0.0, 2.0) << later / 1s;
    hang.hangs = hang.reads_no_mail = false;
    EXPECT_EQ(axis.try_to_switch_off(), "");
  }
}

// Changing set-points are no confirmation of inputs that do not change.
TEST_F(StaleInputs, EndAJogWhoseVelocityChangesAllTheTime) {
  axis.enable();
  std::int32_t velocity = 2 * revolution;
  const Time begun = rig.objects().now();
  const auto demand = [&](const AxisStatus&) -> std::optional<std::int32_t> {
    const Time since = rig.objects().now() - begun;
    if (since > 1s) hang.hangs = true;
    if (since > 20s) return std::nullopt;
    return ++velocity;
  };
  EXPECT_THAT(problem_of([&] {
                axis.jog({{}, 100 * revolution, 100 * revolution}, demand);
              }),
              HasSubstr("the inputs have not changed"));
  EXPECT_LT(rig.objects().now() - begun, 5s);
}

TEST_F(StaleInputs, ALostAnswerEndsNoMotion) {
  axis.enable();
  hang.hangs = true;  // the values stay true while the axis is at rest
  hang.answers_to_lose = 1;
  axis.hold_for(4s);
  EXPECT_EQ(hang.answers_to_lose, 0U) << "the inputs are compared";
  hang.hangs = false;
  axis.disable();
}

TEST_F(StaleInputs, AMailboxWithoutAnswersEndsNoMotionWhoseInputsChange) {
  axis.enable();
  axis.run_at(2 * revolution, {{}, 100 * revolution, 100 * revolution}, 5s);
  hang.reads_no_mail = true;
  axis.hold_for(5s);
  EXPECT_NEAR(rig.drive().plant().velocity_rpm(), 120.0, 2.0);
  axis.stop();
  EXPECT_NEAR(rig.drive().plant().velocity_rpm(), 0.0, 2.0);
}

TEST_F(StaleInputs, DoNotHideThatTheAxisStillTurns) {
  axis.enable();
  axis.run_at(2 * revolution, {{}, 100 * revolution, 100 * revolution}, 5s);
  hang.hangs = true;
  EXPECT_THAT(problem_of([&] { axis.hold_for(10s); }), HasSubstr("the inputs have not changed"));
  EXPECT_EQ(axis.try_to_switch_off(), "");
  EXPECT_NEAR(rig.drive().plant().velocity_rpm(), 0.0, 2.0);
}

TEST_F(StaleInputs, AreNotThoseOfAnAxisAtRest) {
  axis.enable();
  for (int i = 0; i < 200; ++i) {
    axis.status();
    rig.objects().wait(20ms);
  }
  axis.move_by(revolution, quick, 5s);
  axis.hold_for(2s);
  axis.disable();
}

}  // namespace
}  // namespace stale_inputs_test
}  // namespace servodrome::master::test
