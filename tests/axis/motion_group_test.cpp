// The master's own trajectory and an axis that follows it, without a bus: the process data are in memory.
#include "axis/cyclic/motion_group.hpp"

#include <cmath>
#include <gtest/gtest.h>

#include "axis/simulated_drives.hpp"
#include "master/problem_of.hpp"

namespace servodrome::master::test {
namespace motion_group_test {
namespace {

using namespace std::chrono_literals;
constexpr MotionLimits linear{1000.0, 5000.0, 2500.0, 0.0};
constexpr MotionLimits smooth{1000.0, 5000.0, 5000.0, 100'000.0};

TEST(SetPointGenerator, LinearProfileIsTheClosedForm) {
  SetPointGenerator generator(0.001);
  generator.reset({100.0, 0.0, 0.0});
  ASSERT_TRUE(generator.move_to(600.0, 0.0, linear));
  // Accelerates for 0.2 s over 100 counts, decelerates for 0.4 s over 200, and covers 200 at 1000/s in between.
  EXPECT_DOUBLE_EQ(generator.duration_s(), 0.8);
  for (int cycle = 1; cycle <= 900; ++cycle) {
    generator.advance();
    const double t = cycle * 0.001;
    const double position = t <= 0.2   ? 100 + 2500 * t * t
                            : t <= 0.4 ? 200 + 1000 * (t - 0.2)
                            : t <= 0.8 ? 600 - 1250 * (0.8 - t) * (0.8 - t)
                                       : 600;
    ASSERT_NEAR(generator.state().position, position, 1e-9) << cycle;
    EXPECT_EQ(generator.done(), t >= 0.8 - 1e-12) << cycle;
  }
  EXPECT_EQ(generator.state().position, 600.0);
  EXPECT_EQ(generator.state().velocity, 0.0);
}

// The second profile starts exactly at the end of the first, even within a cycle: no time is lost, and the velocity
// does not jump.
TEST(SetPointGenerator, ContinuesAtTheEndOfAProfile) {
  SetPointGenerator generator(0.0007);
  generator.reset({});
  ASSERT_TRUE(generator.move_to(500.0, 400.0, smooth));
  const double first = generator.duration_s();
  while (!generator.done()) generator.advance();
  ASSERT_TRUE(generator.move_to(900.0, 0.0, smooth, SetPointGenerator::From::end));
  const double second = generator.duration_s();
  trajectory::Trajectory exact;
  exact.plan_position({500.0, 400.0, 0.0}, 900.0, 0.0, smooth, trajectory::RampShape::jerk_limited);
  EXPECT_DOUBLE_EQ(second, exact.duration_s());
  const double at = std::ceil(first / 0.0007) * 0.0007;
  EXPECT_NEAR(generator.elapsed_s(), at - first, 1e-12);
  EXPECT_NEAR(generator.state().position, exact.at(at - first).position, 1e-9);
}

TEST(SetPointGenerator, RefusesWhatIsNoLimitAndGoesOn) {
  SetPointGenerator generator(0.001);
  generator.reset({0.0, 50.0, 0.0});
  EXPECT_FALSE(generator.move_to(1.0, 0.0, {0.0, 1.0, 1.0, 0.0}));
  EXPECT_FALSE(generator.run_at(std::nan(""), linear));
  for (int i = 0; i < 100; ++i) generator.advance();
  EXPECT_NEAR(generator.state().position, 5.0, 1e-9);
}

TEST(BrakingDistance, AndItsInverseAgreeWithTheProfile) {
  for (const double jerk : {0.0, 1e3, 1e5, 1e7}) {
    const MotionLimits limits{5000.0, 5000.0, 5000.0, jerk};
    for (const double v : {1.0, 30.0, 900.0, 5000.0}) {
      for (const double end : {0.0, 0.5 * v}) {
        trajectory::Trajectory brake;
        brake.plan_velocity({0.0, v, 0.0}, end, limits,
                            jerk > 0 ? trajectory::RampShape::jerk_limited : trajectory::RampShape::linear);
        const double distance = brake.at(brake.duration_s()).position;
        EXPECT_NEAR(braking_distance(v, end, limits), distance, 1e-9 * distance);
        EXPECT_NEAR(velocity_to_slow_within(distance, end, limits), v, 1e-9 * v);
      }
    }
  }
  EXPECT_EQ(velocity_to_slow_within(-1.0, 3.0, linear), 3.0);
}

class MotionOfSimulatedDrives : public testing::Test {
 protected:
  SimulatedBus bus{3};
  MotionGroup group{bus};
};

TEST_F(MotionOfSimulatedDrives, EnableStepByStepWithoutAJump) {
  bus.drive(1).position = -70'000;
  group.axis(0).switch_on(true);
  std::vector<PowerState> states;
  group.on_cycle([&] {
    if (states.empty() || states.back() != group.axis(0).axis().state()) states.push_back(group.axis(0).axis().state());
  });
  group.wait(20ms);
  EXPECT_EQ(states, (std::vector{PowerState::switch_on_disabled, PowerState::ready_to_switch_on,
                                 PowerState::switched_on, PowerState::operation_enabled}));
  EXPECT_FALSE(group.axis(1).is_enabled());
  group.enable();
  EXPECT_EQ(bus.drive(1).position, -70'000);
  EXPECT_EQ(group.axis(1).set_point().position, -70'000.0);
  group.disable(linear);
  EXPECT_EQ(group.axis(2).axis().state(), PowerState::switch_on_disabled);
}

TEST_F(MotionOfSimulatedDrives, StartAndArriveInTheSameCycle) {
  group.enable();
  for (const MotionLimits& limits : {linear, smooth}) {
    const double from = group.axis(0).set_point().position;
    const std::array targets{from + 3000.0, from - 500.0, from + 20.0};
    std::vector<int> started(3, -1), arrived(3, -1);
    const std::array before{group.axis(0).set_point().position, group.axis(1).set_point().position,
                            group.axis(2).set_point().position};
    int cycle = 0;
    const double duration = group.start_together(targets, std::span(&limits, 1));
    group.on_cycle([&] {
      for (std::size_t i = 0; i < 3; ++i) {
        if (started[i] < 0 && group.axis(i).set_point().position != before[i]) started[i] = cycle;
        if (arrived[i] < 0 && group.axis(i).generator().done()) arrived[i] = cycle;
      }
      ++cycle;
    });
    ASSERT_TRUE(group.wait_until([&] { return group.all_done(); }, 20s));
    group.on_cycle({});
    EXPECT_EQ(started, std::vector<int>(3, started[0]));
    EXPECT_EQ(arrived, std::vector<int>(3, arrived[0]));
    EXPECT_NEAR(arrived[0] * 0.001, duration, 0.0011);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(group.axis(i).set_point().position, targets[i]);
  }
}

TEST_F(MotionOfSimulatedDrives, StartTogetherOrNotAtAll) {
  group.enable();
  const auto refuses = [&](std::span<const double> targets, std::span<const MotionLimits> limits) {
    const std::string problem = problem_of([&] { group.start_together(targets, limits); });
    group.wait(20ms);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(group.axis(i).set_point().position, 0.0) << i;
    return !problem.empty();
  };
  const std::array targets{1000.0, 500.0, 200.0};
  const std::array without_end{1000.0, 500.0, std::nan("")};
  const std::array limits{linear, linear, MotionLimits{}};
  EXPECT_TRUE(refuses(std::span(targets).first(2), std::span(&linear, 1)));
  EXPECT_TRUE(refuses(targets, {}));
  EXPECT_TRUE(refuses(without_end, std::span(&linear, 1)));
  EXPECT_TRUE(refuses(targets, limits));
  group.axis(2).switch_on(false);
  group.wait(20ms);
  EXPECT_TRUE(refuses(targets, std::span(&linear, 1))) << "an axis is off";
}

TEST_F(MotionOfSimulatedDrives, PositionsGoOnWhereTheDrivesWrapAround) {
  bus.drive(0).position = 2'147'483'000;
  group.enable();
  group.axis(0).move_to(2'147'485'000.0, 0.0, linear);
  ASSERT_TRUE(group.wait_until([&] { return group.all_done(); }, 10s));
  group.wait(5ms);
  EXPECT_EQ(group.axis(0).position(), 2'147'485'000);
  EXPECT_LT(group.axis(0).axis().position(), 0);
  EXPECT_EQ(group.axis(0).fault(), AxisFault::none);
}

TEST_F(MotionOfSimulatedDrives, TorqueRampsAndIsHeldBackAtTheVelocityLimit) {
  group.enable();
  ASSERT_TRUE(group.axis(0).apply_torque(500.0, 1000.0, 20'000.0));
  group.wait(300ms);
  EXPECT_NEAR(group.axis(0).torque_set_point(), 300.0, 5.0);
  EXPECT_EQ(group.axis(0).axis().mode(), 10);
  group.wait(5s);
  EXPECT_LT(group.axis(0).velocity(), 20'000.0);
  EXPECT_GT(group.axis(0).velocity(), 17'000.0);
  // Back to position mode: the profile starts at the present velocity.
  const double velocity = group.axis(0).velocity();
  group.axis(0).run_at(0.0, {30'000.0, 50'000.0, 50'000.0, 0.0});
  group.wait(10ms);
  EXPECT_NEAR(group.axis(0).set_point().velocity, velocity - 50'000 * 0.01, 1000.0);
  group.wait(2s);
  EXPECT_EQ(group.axis(0).set_point().velocity, 0.0);
  EXPECT_EQ(group.axis(0).axis().mode(), 8);
}

TEST_F(MotionOfSimulatedDrives, VelocityModeIsCommandedAsVelocity) {
  group.enable();
  ASSERT_TRUE(group.axis(0).run_in_velocity_mode(-800.0, linear));
  group.wait(1s);
  EXPECT_EQ(group.axis(0).axis().mode(), 9);
  EXPECT_NEAR(group.axis(0).velocity(), -800.0, 1.0);
}

TEST_F(MotionOfSimulatedDrives, ATargetBeyondItsObjectKeepsItsDirection) {
  group.enable();
  ASSERT_TRUE(group.axis(0).run_in_velocity_mode(3e9, {1e10, 1e11, 1e11, 0.0}));
  ASSERT_TRUE(group.axis(1).apply_torque(40'000.0, 1e6, 0.0));
  group.wait(500ms);
  EXPECT_NEAR(group.axis(0).velocity(), 2'147'483'647.0, 1.0);
  EXPECT_EQ(bus.image(1).output({0x6071, 0})->get<std::int16_t>(), 32767);
}

TEST_F(MotionOfSimulatedDrives, HomingChangesTheCount) {
  bus.drive(0).position = 5555;
  group.enable();
  ASSERT_TRUE(group.axis(0).home());
  EXPECT_FALSE(group.axis(0).move_to(1.0, 0.0, linear)) << "not while homing";
  ASSERT_TRUE(group.wait_until([&] { return group.axis(0).is_homed(); }, 1s));
  EXPECT_EQ(group.axis(0).set_point().position, 0.0);
  group.wait(10ms);
  EXPECT_EQ(group.axis(0).axis().mode(), 8);
  EXPECT_EQ(bus.drive(0).position, 0);
  bus.drive(0).homing_fails = true;
  ASSERT_TRUE(group.axis(0).home());
  EXPECT_NE(problem_of([&] { group.wait(1s); }).find("homing failed"), std::string::npos);
}

TEST_F(MotionOfSimulatedDrives, FaultsStopNameThemselvesAndAreReset) {
  group.enable();
  group.axis(0).run_at(500.0, linear);
  group.wait(100ms);
  bus.drive(0).break_down(0x3210);
  EXPECT_NE(problem_of([&] { group.wait(10ms); }).find("the drive has a fault, 603Fh is 3210h DC link over-voltage"),
            std::string::npos);
  EXPECT_EQ(group.axis(0).fault(), AxisFault::drive_fault);
  EXPECT_FALSE(group.axis(0).is_enabled());
  group.reset_faults();
  group.enable();
  bus.drive(0).switch_off_by_itself();
  EXPECT_NE(problem_of([&] { group.wait(10ms); }).find("left operation enabled by itself"), std::string::npos);
  group.reset_faults();
  group.enable();
  EXPECT_TRUE(group.axis(0).is_enabled());
}

TEST_F(MotionOfSimulatedDrives, LostDataStopTheAxisAfterWhatIsTolerated) {
  group.enable();
  group.axis(0).run_at(500.0, linear);
  group.wait(500ms);
  bus.drive(0).is_silent = true;
  bus.run_cycles(10);
  EXPECT_EQ(group.axis(0).fault(), AxisFault::none);
  bus.run_cycles(1);
  EXPECT_EQ(group.axis(0).fault(), AxisFault::communication_lost);
  bus.drive(0).is_silent = false;
  bus.run_cycles(5);
  EXPECT_NE(bus.drive(0).state, PowerState::operation_enabled) << "quick stop";
}

TEST_F(MotionOfSimulatedDrives, AFollowingErrorStopsTheAxis) {
  SimulatedBus one{1};
  const std::array options{MotionAxisOptions{.following_error_limit = 50.0}};
  MotionGroup strict(one, options);
  strict.enable();
  strict.axis(0).run_at(500.0, linear);
  strict.wait(500ms);
  EXPECT_LT(std::abs(strict.axis(0).following_error()), 1.5);
  one.drive(0).is_blocked = true;
  EXPECT_NE(problem_of([&] { strict.wait(500ms); }).find("following error is too large"), std::string::npos);
}

TEST_F(MotionOfSimulatedDrives, AModeThatIsRefusedIsAFault) {
  bus.drive(0).modes = {8};
  group.enable();
  ASSERT_TRUE(group.axis(0).apply_torque(10.0, 1000.0, 0.0));
  EXPECT_NE(problem_of([&] { group.wait(2s); }).find("does not accept the mode"), std::string::npos);
}

// A drive breaks down while all brake: the others brake to the end of their ramps, and are switched off.
TEST_F(MotionOfSimulatedDrives, AFaultWhileDisablingDoesNotKeepTheOthersEnabled) {
  group.enable();
  for (std::size_t i = 0; i < 3; ++i) ASSERT_TRUE(group.axis(i).run_at(1000.0, linear));
  group.wait(500ms);
  const std::array begin{bus.drive(1).position, bus.drive(2).position};
  int cycle = 0;
  group.on_cycle([&] {
    if (++cycle == 100) bus.drive(0).break_down(0x3210);
  });
  EXPECT_NE(problem_of([&] { group.disable(linear); }).find("the drive has a fault, 603Fh is 3210h"),
            std::string::npos);
  for (std::size_t i = 1; i < 3; ++i) {
    EXPECT_EQ(bus.drive(i).state, PowerState::switch_on_disabled) << i;
    EXPECT_NEAR(static_cast<double>(bus.drive(i).position - begin[i - 1]), 200.0, 3.0) << i;
  }
}

// A deceleration that is too low for the time to stop: the axis must not be switched off while it moves.
TEST_F(MotionOfSimulatedDrives, AStopThatTakesTooLongEndsInAQuickStop) {
  bus.drive(1).quick_stop_cycles = 50;
  group.enable();
  ASSERT_TRUE(group.axis(1).run_at(1000.0, linear));
  group.wait(500ms);
  bus.drive(1).controlwords.clear();
  MotionLimits slow = linear;
  slow.deceleration = 100.0;
  EXPECT_NE(problem_of([&] { group.disable(slow, 1s); }).find("stopped by a quick stop"), std::string::npos);
  ASSERT_GE(bus.drive(1).controlwords.size(), 2U);
  EXPECT_EQ(bus.drive(1).controlwords[1], 0x0002);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(bus.drive(i).state, PowerState::switch_on_disabled) << i;
}

TEST_F(MotionOfSimulatedDrives, ADisableWithBadLimitsChangesNothing) {
  group.enable();
  ASSERT_TRUE(group.axis(0).run_at(1000.0, linear));
  MotionLimits none = linear;
  none.deceleration = 0.0;
  EXPECT_NE(problem_of([&] { group.disable(none); }).find("a limit is not above 0"), std::string::npos);
  EXPECT_TRUE(group.axis(0).is_enabled());
}

// What the group does not know of a drive is not that it is off.
TEST(BeginOfAMotionGroup, ADisableNeedsTheStatesOfTheDrives) {
  SimulatedBus bus{2};
  bus.drive(1).is_silent = true;
  MotionGroup group(bus);
  EXPECT_NE(problem_of([&] { group.disable(linear, 100ms); }).find("its process data were not received"),
            std::string::npos);
}

// As after a restart of the program: the group has not run a cycle yet, and so has not read the states of its drives.
TEST(BeginOfAMotionGroup, AResetFindsFaultsFromBefore) {
  SimulatedBus bus{3};
  bus.drive(1).break_down(0x8130);
  MotionGroup group(bus);
  group.reset_faults(100ms);
  EXPECT_EQ(bus.drive(1).state, PowerState::switch_on_disabled);
  group.enable();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(bus.drive(i).state, PowerState::operation_enabled) << i;
}

TEST_F(MotionOfSimulatedDrives, AResetThatFailsDoesNotGoOn) {
  group.enable();
  bus.drive(0).stays_broken = true;
  bus.drive(0).break_down(0x3210);
  EXPECT_NE(problem_of([&] { group.wait(10ms); }).find("the drive has a fault"), std::string::npos);
  EXPECT_NE(
      problem_of([&] { group.reset_faults(50ms); }).find("cannot be reset: the drive has a fault, 603Fh is 3210h"),
      std::string::npos);
  EXPECT_FALSE(group.axis(0).is_resetting());
  bus.run_cycles(2);
  bus.drive(0).stays_broken = false;
  EXPECT_NE(problem_of([&] { group.wait(10ms); }).find("the drive has a fault"), std::string::npos);
  bus.run_cycles(20);
  EXPECT_EQ(bus.drive(0).state, PowerState::fault);
}

TEST(EndOfAMotionGroup, CommandsAQuickStopToTheEnabledDrives) {
  SimulatedBus bus{2};
  {
    MotionGroup group(bus);
    group.axis(0).switch_on(true);
    group.wait(20ms);
    ASSERT_TRUE(group.axis(0).is_enabled());
  }
  EXPECT_EQ(bus.drive(0).output({0x6040, 0})->get<std::uint16_t>(), 0x0002);
  EXPECT_EQ(bus.drive(1).output({0x6040, 0})->get<std::uint16_t>(), 0x0000);
  bus.run_cycles(1);
  EXPECT_NE(bus.drive(0).state, PowerState::operation_enabled);
}

}  // namespace
}  // namespace motion_group_test
}  // namespace servodrome::master::test
