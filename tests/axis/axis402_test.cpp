// The master's axis with complete drives and motors, in virtual time: both products of the built-in line.
#include "axis/axis402.hpp"

#include <gtest/gtest.h>

#include "line/line.hpp"
#include "line/support.hpp"
#include "master/canopen/master.hpp"
#include "master/canopen/scan.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/problem_of.hpp"

namespace servodrome::master {
namespace axis402_test {
namespace {

using test::problem_of;

using namespace std::chrono_literals;
constexpr std::int32_t revolution = 131072;

// Both axes can travel 10 revolutions in either direction between their limit switches.
constexpr const char* two_drives = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "one"
product = "ismc"
node = 1
[axis.travel]
counts_per_unit = 131072
low_stop = -11
high_stop = 11
negative_limit = -10
positive_limit = 10
home = { from = -0.5, to = 0.5 }
start = 2
[[axis]]
name = "two"
product = "generic402"
node = 2
[axis.travel]
counts_per_unit = 131072
low_stop = -11
high_stop = 11
negative_limit = -10
positive_limit = 10
home = { from = -0.5, to = 0.5 }
start = 2
)";

class Axis402Test : public ::testing::TestWithParam<int> {
 protected:
  line::Line line{line::test::settings_of(two_drives)};
  Bus bus{std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line};
  SdoClient objects{bus, static_cast<std::uint8_t>(GetParam())};
  Axis402 axis{objects};
  const MotionProfile profile{5 * revolution, 50 * revolution, 50 * revolution};
  const HomingRequest homing{17, 2 * revolution, revolution / 2, 20 * revolution, 0};

  line::Axis& drive() { return *line.axes()[static_cast<std::size_t>(GetParam() - 1)]; }
  void SetUp() override { bus.run_for(100ms); }
};
INSTANTIATE_TEST_SUITE_P(BothProducts, Axis402Test, ::testing::Values(1, 2));

TEST_P(Axis402Test, WalksThePowerStates) {
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
  axis.enable();
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
  axis.enable();
  axis.quick_stop();
  EXPECT_NE(axis.state(), PowerState::operation_enabled);
  axis.enable();
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
  axis.disable();
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
}

TEST_P(Axis402Test, HomesAndMovesToTheCount) {
  axis.enable();
  axis.home(homing, 30s);
  EXPECT_EQ(axis.status().mode, 6);
  int looks = 0;
  axis.move_to(3 * revolution, profile, 5s, [&](const AxisStatus& status) {
    ++looks;
    EXPECT_EQ(status.state(), PowerState::operation_enabled);
  });
  EXPECT_GT(looks, 50);
  bus.run_for(300ms);
  EXPECT_NEAR(axis.position(), 3 * revolution, 20);
  axis.move_by(-revolution, profile, 5s);
  axis.move_by(-revolution, profile, 5s);
  bus.run_for(300ms);
  EXPECT_NEAR(axis.position(), revolution, 20);
}

TEST_P(Axis402Test, AStoppedMoveIsDropped) {
  axis.enable();
  axis.home(homing, 30s);
  struct Enough {};
  EXPECT_THROW(axis.move_to(15 * revolution, profile, 10s,
                            [&](const AxisStatus& status) {
                              if (status.position < 3 * revolution) return;
                              axis.stop();
                              throw Enough{};
                            }),
               Enough);
  bus.run_for(300ms);
  const std::int32_t stopped_at = axis.position();
  EXPECT_GT(stopped_at, 3 * revolution);
  EXPECT_LT(stopped_at, 4 * revolution);
  bus.run_for(500ms);
  EXPECT_NEAR(axis.position(), stopped_at, 20) << "it stays where it stands";
  axis.move_by(revolution, profile, 5s);
  bus.run_for(300ms);
  EXPECT_NEAR(axis.position(), stopped_at + revolution, 50);
}

TEST_P(Axis402Test, AMoveThatTakesTooLongIsStoppedAndSaysSo) {
  axis.enable();
  axis.home(homing, 30s);
  const std::string problem = problem_of([&] { axis.move_to(10 * revolution, profile, 500ms); });
  EXPECT_NE(problem.find("moving to 1310720 took longer than 0.5 s and was stopped"), std::string::npos) << problem;
  bus.run_for(100ms);  // the drive reports the velocity with a delay
  EXPECT_EQ(axis.velocity() / 1000, 0);
}

TEST_P(Axis402Test, RunsAtAVelocityAndStops) {
  axis.enable();
  axis.home(homing, 30s);
  axis.run_at(2 * revolution, profile, 2s);
  bus.run_for(200ms);
  EXPECT_NEAR(axis.velocity(), 2 * revolution, revolution / 20);
  axis.stop();
  bus.run_for(100ms);
  EXPECT_NEAR(axis.velocity(), 0, revolution / 100);
}

TEST_P(Axis402Test, NamesTheFaultAndResetsIt) {
  axis.enable();
  drive().inject(drive::Cause::over_voltage, true);
  bus.run_for(50ms);
  const std::string problem = problem_of([&] { axis.move_to(revolution, profile, 5s); });
  EXPECT_NE(problem.find("state fault"), std::string::npos) << problem;
  EXPECT_NE(problem.find("error code 603Fh 3210h DC link over-voltage, latest EMCY 3210h"), std::string::npos)
      << problem;
  EXPECT_NE(problem_of([&] { axis.enable(); }).find("reset it"), std::string::npos);
  EXPECT_NE(problem_of([&] { axis.reset_fault(); }).find("cannot be reset"), std::string::npos);
  drive().inject(drive::Cause::over_voltage, false);
  axis.reset_fault();
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
  axis.enable();
}

TEST_P(Axis402Test, AFaultReactionThatLastsIsNotReportedAsAReset) {
  axis.enable();
  objects.write<std::int16_t>(0x605E, 0, 1);  // braking with 6084h
  axis.run_at(5 * revolution, profile, 2s);
  objects.write<std::uint32_t>(0x6084, 0, revolution);
  drive().inject(drive::Cause::over_voltage, true);
  bus.run_for(50ms);
  ASSERT_EQ(axis.state(), PowerState::fault_reaction_active);
  EXPECT_NE(problem_of([&] { axis.reset_fault(); }).find("fault reaction"), std::string::npos);
  EXPECT_EQ(axis.state(), PowerState::fault_reaction_active);
}

TEST_P(Axis402Test, RefusesWhatCannotBe) {
  EXPECT_NE(problem_of([&] { axis.move_to(0, profile, 1s); }).find("not enabled"), std::string::npos);
  EXPECT_NE(problem_of([&] { axis.home(homing, 1s); }).find("not enabled"), std::string::npos);
  axis.enable();
  EXPECT_NE(problem_of([&] { axis.set_mode(static_cast<OperationMode>(5)); }).find("does not have mode 5"),
            std::string::npos);
}

TEST_P(Axis402Test, IsFoundByAScanAsADrive) {
  const auto nodes = scan(bus);
  ASSERT_EQ(nodes.size(), 2U);
  EXPECT_TRUE(nodes[0].is_drive());
  EXPECT_EQ(nodes[static_cast<std::size_t>(GetParam() - 1)].node_id, GetParam());
  EXPECT_NE(nodes[0].identity, nodes[1].identity);
}

TEST(Statusword, StatesAndBitsInWords) {
  EXPECT_EQ(state_of(0x0000), PowerState::not_ready_to_switch_on);
  EXPECT_EQ(state_of(0x0250), PowerState::switch_on_disabled);
  EXPECT_EQ(state_of(0x0231), PowerState::ready_to_switch_on);
  EXPECT_EQ(state_of(0x0233), PowerState::switched_on);
  EXPECT_EQ(state_of(0x1637), PowerState::operation_enabled);
  EXPECT_EQ(state_of(0x0217), PowerState::quick_stop_active);
  EXPECT_EQ(state_of(0x021F), PowerState::fault_reaction_active);
  EXPECT_EQ(state_of(0x023F), PowerState::fault_reaction_active);
  EXPECT_EQ(state_of(0x0218), PowerState::fault);
  EXPECT_EQ(text_of_statusword(0x0218), "0218h (fault, voltage enabled, remote)");
  EXPECT_EQ(text_of_statusword(0), "0000h (no bit set)");
}

}  // namespace
}  // namespace axis402_test
}  // namespace servodrome::master
