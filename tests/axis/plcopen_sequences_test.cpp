// Sequences of function blocks that command an axis while something else is under way: a stop after a reset, homing of
// a master with slaves, a switch-off of one cycle, a change of the mode. Drives without control loops, cycle by cycle.
#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>

#include "axis/cia402_words.hpp"
#include "axis/plcopen/controller.hpp"
#include "axis/simulated_drives.hpp"

namespace servodrome::master::plcopen {
namespace plcopen_sequences_test {
namespace {

using namespace std::chrono_literals;
using test::SimulatedBus;
using test::SimulatedDrive;

class Sequences : public testing::Test {
 protected:
  SimulatedBus bus{2};
  Controller controller{bus};
  Axis& axis = controller.axis(0);
  Axis& other = controller.axis(1);
  SimulatedDrive& drive = bus.drive(0);
  MC_Power power, other_power;
  MC_MoveVelocity run;
  MC_Reset reset;

  void SetUp() override {
    power.Enable = other_power.Enable = true;
    set_dynamics(run);
    program([] {});
    ASSERT_TRUE(controller.run_until([&] { return power.Status && other_power.Status; }, 1s));
    drive.controlwords.clear();
  }
  void program(const std::function<void()>& body) {
    controller.on_cycle([this, body] {
      power(axis);
      other_power(other);
      body();
    });
  }
  // One count per cycle, with practically no acceleration time.
  template <typename Block>
  static void set_dynamics(Block& block, double velocity = 1000.0) {
    block.Velocity = velocity;
    block.Acceleration = block.Deceleration = 1e9;
  }
  bool has_commanded(std::uint16_t bits) const {
    return std::any_of(drive.controlwords.begin(), drive.controlwords.end(),
                       [bits](std::uint16_t word) { return (word & bits) == bits; });
  }
  void run_until_position(double position) {
    run.Execute = true;
    ASSERT_TRUE(controller.run_until([&] { return axis.commanded_position() >= position; }, 5s));
  }
};

// ---- Targets ----

TEST_F(Sequences, AdditiveAfterARunAddsToThePresentSetPoint) {
  MC_MoveAbsolute move;
  MC_MoveAdditive add;
  MC_Halt halt;
  move.Position = 100.0;
  add.Distance = 10.0;
  halt.Deceleration = 10'000.0;
  set_dynamics(move);
  set_dynamics(add);
  move.Execute = true;
  program([&] {
    move(axis);
    run(axis);
    halt(axis);
    add(axis);
  });
  ASSERT_TRUE(controller.run_until([&] { return move.Done; }, 1s));
  run_until_position(500.0);
  const double before = axis.commanded_position();
  add.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return add.Done; }, 1s));
  EXPECT_NEAR(axis.commanded_position(), before + 10.0, 1.0);
  // The same while a halt brakes a move.
  move.Execute = add.Execute = run.Execute = false;
  controller.run_for(2ms);
  move.Position = 2000.0;
  move.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return axis.commanded_position() >= 700.0; }, 1s));
  halt.Execute = true;
  controller.run_for(5ms);
  const double braking = axis.commanded_position();
  add.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return add.Done; }, 1s));
  EXPECT_NEAR(axis.commanded_position(), braking + 10.0, 1.0);
}

// ---- Reset, power and lost data ----

// A usual program resets as soon as MC_Power shows the error.
TEST_F(Sequences, AResetInTheCycleOfTheFaultDoesNotTakeBackTheStop) {
  axis.configuration().enable_lag_monitoring = true;
  axis.configuration().max_position_lag = 20.0;
  program([&] {
    reset.Execute = power.Error;
    reset(axis);
    run(axis);
  });
  run_until_position(50.0);
  drive.is_blocked = true;
  ASSERT_TRUE(controller.run_until([&] { return drive.state != PowerState::operation_enabled; }, 1s));
  EXPECT_EQ(drive.controlwords.back(), command_word::quick_stop);
}

TEST_F(Sequences, AResetWaitsForTheEndOfTheQuickStop) {
  axis.configuration().enable_lag_monitoring = true;
  axis.configuration().max_position_lag = 20.0;
  drive.quick_stop_cycles = 100;
  program([&] {
    reset(axis);
    run(axis);
  });
  run_until_position(50.0);
  drive.is_blocked = true;
  ASSERT_TRUE(controller.run_until([&] { return drive.state == PowerState::quick_stop_active; }, 1s));
  reset.Execute = true;
  controller.run_for(80ms);  // the drive still brakes
  EXPECT_EQ(drive.state, PowerState::quick_stop_active);
  EXPECT_FALSE(reset.Done);
  ASSERT_TRUE(controller.run_until([&] { return reset.Done && power.Status; }, 1s));
  EXPECT_EQ(axis.state(), AxisState::Standstill);
}

TEST_F(Sequences, AFailedResetDoesNotGoOn) {
  program([&] { reset(axis); });
  drive.is_blocked = true;
  drive.break_down(0x3210);
  drive.stays_broken = true;
  controller.run_for(5ms);
  reset.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return reset.Error; }, 5s));
  EXPECT_EQ(reset.ErrorID, ErrorId::reset_failed);
  drive.stays_broken = false;  // the cause is gone, and no new reset is asked for
  drive.controlwords.clear();
  controller.run_for(1s);
  EXPECT_FALSE(has_commanded(command_word::fault_reset));
  EXPECT_EQ(axis.state(), AxisState::ErrorStop);
  EXPECT_FALSE(power.Status);
}

// The first cause is gone, and another one prevents the reset.
TEST_F(Sequences, AFailedResetShowsTheFaultThatPreventsIt) {
  program([&] { reset(axis); });
  drive.is_silent = true;
  controller.run_for(20ms);
  ASSERT_EQ(axis.error(), ErrorId::communication_lost);
  drive.is_silent = false;
  drive.break_down(0x7320);
  drive.stays_broken = true;
  controller.run_for(5ms);
  EXPECT_EQ(axis.error(), ErrorId::communication_lost) << "the first one is the cause";
  reset.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return reset.Error; }, 5s));
  EXPECT_EQ(axis.error(), ErrorId::drive_fault);
  EXPECT_EQ(axis.drive_error_code(), 0x7320);
}

TEST_F(Sequences, NothingIsEnabledOrResetByOldInputs) {
  program([&] {
    reset(axis);
    run(axis);
  });
  run_until_position(50.0);
  drive.is_silent = true;
  controller.run_for(20ms);
  EXPECT_EQ(axis.state(), AxisState::ErrorStop);
  reset.Execute = true;
  controller.run_for(100ms);
  EXPECT_FALSE(reset.Done || power.Status);
  EXPECT_FALSE(commands_operation(axis.motion().axis().controlword()));
  drive.is_silent = false;
  ASSERT_TRUE(controller.run_until([&] { return reset.Done && power.Status; }, 1s));
}

TEST_F(Sequences, SwitchedOffForACycleTheDriveWasOff) {
  for (const int cycles : {1, 2, 5}) {
    program([&] { run(axis); });
    run.Execute = false;
    controller.run_for(2ms);
    run_until_position(axis.commanded_position() + 50.0);
    drive.controlwords.clear();
    power.Enable = false;
    controller.run_for(cycles * 1ms);
    power.Enable = true;
    controller.run_for(2ms);
    ASSERT_TRUE(controller.run_until([&] { return power.Status; }, 1s));
    EXPECT_EQ(drive.controlwords.front(), command_word::enable_operation);
    EXPECT_EQ(drive.controlwords.at(1), command_word::disable_voltage) << cycles;
    EXPECT_EQ(axis.state(), AxisState::Standstill);
    EXPECT_EQ(axis.error(), ErrorId::none);
  }
}

TEST_F(Sequences, SwitchedOffWithoutDataTheSetPointsEnd) {
  program([&] { run(axis); });
  run_until_position(50.0);
  drive.is_silent = true;
  power.Enable = false;
  controller.run_for(1ms);
  const double before = axis.commanded_position();
  controller.run_for(5ms);
  EXPECT_EQ(axis.commanded_position(), before);
  EXPECT_EQ(axis.motion().axis().controlword(), command_word::disable_voltage);
}

TEST_F(Sequences, AFaultLeavesNoWordThatEnables) {
  power.Enable = false;
  program([] {});
  controller.run_for(5ms);
  power.Enable = true;
  ASSERT_TRUE(controller.run_until([&] { return commands_operation(axis.motion().axis().controlword()); }, 1s));
  drive.is_silent = true;  // before the drive has shown operation enabled
  controller.run_for(20ms);
  EXPECT_EQ(axis.error(), ErrorId::communication_lost);
  EXPECT_EQ(axis.motion().axis().controlword(), command_word::quick_stop);
}

// ---- Homing and modes ----

TEST_F(Sequences, AStopRightAfterHomeBeginsNoHoming) {
  MC_Home home;
  MC_Stop stop;
  stop.Deceleration = 1000.0;
  drive.mode_delay = 5;
  program([&] {
    stop(axis);
    home(axis);
  });
  home.Execute = true;
  controller.run_for(1ms);
  stop.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return stop.Done; }, 1s));
  controller.run_for(50ms);
  EXPECT_FALSE(has_commanded(start_homing));
}

TEST_F(Sequences, ADriveThatIgnoresTheHaltInHomingGetsAQuickStop) {
  MC_Home home;
  MC_Stop stop;
  stop.Deceleration = 1000.0;
  drive.homing_cycles = 1'000'000;
  drive.ignores_halt = drive.is_homing_moving = true;
  program([&] {
    stop(axis);
    home(axis);
  });
  home.Execute = true;
  controller.run_for(100ms);
  stop.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return drive.state != PowerState::operation_enabled; }, 5s));
  EXPECT_EQ(stop.ErrorID, ErrorId::homing_failed);
}

TEST_F(Sequences, AnAbortedHomingKeepsTheTurnsOfThePosition) {
  MC_Home home;
  MC_Stop stop;
  stop.Deceleration = 1000.0;
  const auto off_and_on = [&] {
    power.Enable = false;
    controller.run_for(5ms);
    power.Enable = true;
    controller.run_for(50ms);
  };
  power.Enable = false;
  controller.run_for(5ms);
  drive.position = 2'147'483'600;
  off_and_on();
  drive.homing_cycles = 1'000'000;
  program([&] {
    stop(axis);
    home(axis);
    run(axis);
  });
  run_until_position(2'147'483'800.0);  // beyond 32 bits
  off_and_on();
  const double before = axis.actual_position();
  EXPECT_GT(before, 2'147'483'647.0);
  home.Execute = true;
  controller.run_for(100ms);
  stop.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return stop.Done; }, 1s));
  EXPECT_EQ(axis.actual_position(), before);
}

TEST_F(Sequences, AProfileWaitsForTheMode) {
  MC_TorqueControl torque;
  MC_Stop stop;
  torque.Torque = 50.0;
  torque.TorqueRamp = 1e6;
  stop.Deceleration = 100'000.0;
  drive.mode_delay = 20;
  program([&] {
    stop(axis);
    torque(axis);
  });
  torque.Execute = true;
  controller.run_for(500ms);
  EXPECT_TRUE(torque.InTorque);
  const double velocity = axis.actual_velocity();
  EXPECT_GT(velocity, 1000.0);
  stop.Execute = true;
  while (drive.mode == 10) {
    controller.run_for(1ms);
    EXPECT_FALSE(stop.Done);
    const double next =
        static_cast<double>(drive.position) + velocity / 1000.0;  // where the shaft is in the next cycle
    EXPECT_NEAR(axis.commanded_position(), next, 1.5);
  }
  ASSERT_TRUE(controller.run_until([&] { return stop.Done; }, 1s));
  controller.run_for(5ms);
  EXPECT_EQ(axis.actual_velocity(), 0.0);
}

TEST(IgnoredTarget, IsNotReachedAndWithATimeoutAFault) {
  for (const Time timeout : {Time{0}, Time{500ms}}) {
    SimulatedBus bus{1};
    const std::array options{MotionAxisOptions{.following_timeout = timeout}};
    Controller controller(bus, {}, options);
    Axis& axis = controller.axis(0);
    MC_Power power;
    MC_MoveAbsolute move;
    power.Enable = true;
    move.Position = 100.0;
    move.Velocity = 1000.0;
    move.Acceleration = move.Deceleration = 1e9;
    controller.on_cycle([&] {
      power(axis);
      move.Execute = move.Execute || power.Status;
      move(axis);
    });
    ASSERT_TRUE(controller.run_until([&] { return axis.commanded_position() >= 30.0; }, 1s));
    bus.drive(0).ignores_target = true;
    controller.run_for(2s);
    EXPECT_FALSE(move.Done);
    EXPECT_EQ(move.ErrorID, timeout == Time{0} ? ErrorId::none : ErrorId::not_following);
    EXPECT_EQ(bus.drive(0).state == PowerState::operation_enabled, timeout == Time{0});
  }
}

// ---- Limits ----

TEST_F(Sequences, AnAxisThatLeftItsMasterStopsAtTheLimit) {
  MC_GearIn gear;
  MC_GearOut out;
  gear.Acceleration = gear.Deceleration = 1e6;
  other.configuration().positive_limit = 500.0;
  other.configuration().enable_positive_limit = true;
  program([&] {
    run(axis);
    gear(axis, other);
    out(other);
  });
  run.Execute = gear.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return other.commanded_position() >= 200.0; }, 1s));
  out.Execute = true;
  controller.run_for(2s);
  EXPECT_EQ(other.error(), ErrorId::software_limit_reached);
  EXPECT_NEAR(other.commanded_position(), 500.0, 1.1);
}

TEST_F(Sequences, AWeakHaltNearTheLimitIsBrakedHarder) {
  MC_Halt halt;
  halt.Deceleration = 1000.0;
  run.Deceleration = 20'000.0;
  axis.configuration().positive_limit = 100.0;
  axis.configuration().enable_positive_limit = true;
  program([&] {
    run(axis);
    halt(axis);
  });
  run_until_position(70.0);
  halt.Execute = true;
  controller.run_for(2s);
  EXPECT_EQ(halt.ErrorID, ErrorId::software_limit_reached);
  EXPECT_LE(axis.commanded_position(), 101.1);
  EXPECT_EQ(axis.commanded_velocity(), 0.0);
}

TEST_F(Sequences, AnAxisThatStillAcceleratesWithAJerkStopsAtTheLimit) {
  run.Velocity = 4000.0;
  run.Acceleration = run.Deceleration = 20'000.0;
  run.Jerk = 500'000.0;
  axis.configuration().positive_limit = 300.0;
  axis.configuration().enable_positive_limit = true;
  program([&] { run(axis); });
  run.Execute = true;
  controller.run_for(2s);
  EXPECT_EQ(axis.error(), ErrorId::software_limit_reached);
  EXPECT_LE(axis.commanded_position(), 304.1);
  EXPECT_GE(axis.commanded_position(), 290.0);
}

TEST_F(Sequences, ShutDownWaitsForAnAxisThatBrakesInErrorStop) {
  run.Acceleration = run.Deceleration = 20'000.0;
  axis.configuration().positive_limit = 100.0;
  axis.configuration().enable_positive_limit = true;
  program([&] { run(axis); });
  run.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return axis.state() == AxisState::ErrorStop; }, 1s));
  EXPECT_GT(axis.commanded_velocity(), 100.0);
  controller.shut_down(20'000.0);
  EXPECT_NEAR(static_cast<double>(drive.position), 100.0, 2.0);
  EXPECT_EQ(drive.state, PowerState::switch_on_disabled);
}

TEST_F(Sequences, AProgramThatFailsIsShutDown) {
  run.Acceleration = run.Deceleration = 20'000.0;
  program([&] { run(axis); });
  const auto fails = [&] {
    run_until_position(100.0);
    throw std::runtime_error("the program's own error");
  };
  EXPECT_THROW(controller.run(fails, 20'000.0), std::runtime_error);
  EXPECT_NEAR(static_cast<double>(drive.position), 100.0 + 25.0, 3.0) << "braked, and then disabled";
  EXPECT_EQ(drive.state, PowerState::switch_on_disabled);
}

// ---- Master and slave ----

TEST_F(Sequences, HomingOrLossOfTheMasterDoesNotMoveASlave) {
  MC_GearIn gear;
  MC_Home home;
  MC_MoveAbsolute move;
  gear.Acceleration = gear.Deceleration = 1e6;
  move.Position = 5000.0;
  set_dynamics(move, 10'000.0);
  program([&] {
    move(axis);
    home(axis);
    gear(axis, other);
  });
  move.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return move.Done; }, 2s));
  gear.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return gear.InGear; }, 1s));
  const std::int64_t before = bus.drive(1).position;
  home.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return home.Done; }, 1s));
  controller.run_for(20ms);
  EXPECT_EQ(bus.drive(1).position, before);
  EXPECT_TRUE(gear.InGear);
  // The coupling goes on from the new origin.
  move.Execute = false;
  controller.run_for(2ms);
  move.Position = 100.0;
  move.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return move.Done; }, 1s));
  controller.run_for(5ms);
  EXPECT_EQ(bus.drive(1).position, before + 100);
  drive.is_blocked = true;  // its set-point leaves its position
  move.Execute = false;
  controller.run_for(2ms);
  move.Position = 200.0;
  move.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return move.Done; }, 1s));
  const double set_point = other.commanded_position();
  power.Enable = false;
  controller.run_for(20ms);
  EXPECT_NEAR(other.commanded_position(), set_point, 1e-6);
}

TEST_F(Sequences, SetPositionMovesNoSlaveOfACam) {
  MC_CamIn cam;
  MC_SetPosition set, set_master;
  set_dynamics(run, 1000.0);
  cam.CamTableID = std::make_shared<CamTable>(
      CamTable::through({{0.0, 0.0}, {100.0, 50.0}, {200.0, 0.0}, {300.0, -50.0}, {400.0, 0.0}}, true));
  set.Position = 50.0;
  set.Relative = set_master.Relative = true;
  set_master.Position = 130.0;
  double before = 0.0;
  double greatest_step = 0.0;
  program([&] {
    cam(axis, other);
    run(axis);
    set(other);
    set_master(axis);
    const double here = other.motion().set_point().position;
    greatest_step = std::max(greatest_step, std::abs(here - before));
    before = here;
  });
  cam.Execute = run.Execute = true;
  controller.run_for(150ms);
  set.Execute = true;
  controller.run_for(150ms);
  set_master.Execute = true;
  controller.run_for(300ms);
  EXPECT_TRUE(set.Done && set_master.Done && cam.InSync);
  EXPECT_LT(greatest_step, 1.5) << "the steepest place of the cam";
  EXPECT_GT(greatest_step, 0.3);
}

TEST_F(Sequences, ACommandBehindAnEndlessOneBegins) {
  MC_TorqueControl torque;
  MC_Halt halt;
  torque.Torque = 50.0;
  torque.TorqueRamp = 10'000.0;
  halt.Deceleration = 1e6;
  halt.Mode = BufferMode::Buffered;
  program([&] {
    torque(axis);
    halt(axis);
  });
  torque.Execute = halt.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return halt.Done; }, 2s));
  EXPECT_TRUE(torque.CommandAborted);
}

// ---- Values ----

TEST_F(Sequences, ValuesThatNoDriveCanFollowAreRefused) {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  EXPECT_THROW(Axis(axis.motion(), {.max_velocity = infinite}), MasterError);
  EXPECT_THROW(Axis(axis.motion(), {.max_deceleration = 0.0}), MasterError);
  struct Case {
    double torque;
    double velocity;
    ErrorId error;
  };
  axis.configuration().max_velocity = 5000.0;
  for (const Case& one :
       {Case{33'000.0, 100.0, ErrorId::parameter_invalid}, Case{-40'000.0, 100.0, ErrorId::parameter_invalid},
        Case{100.0, infinite, ErrorId::parameter_invalid}, Case{100.0, 5001.0, ErrorId::above_limit}}) {
    MC_TorqueControl torque;
    torque.Torque = one.torque;
    torque.Velocity = one.velocity;
    torque.TorqueRamp = 1000.0;
    torque.Execute = true;
    torque(axis);
    EXPECT_EQ(torque.ErrorID, one.error);
  }
  MC_CamIn cam;
  cam.CamTableID = std::make_shared<CamTable>(CamTable::through({{0.0, 0.0}, {100.0, 50.0}}, false));
  cam.MasterScaling = std::nan("");
  cam.SlaveAbsolute = false;
  cam.Execute = true;
  cam(axis, other);
  EXPECT_EQ(cam.ErrorID, ErrorId::parameter_invalid);
}

TEST_F(Sequences, ASlaveThatWouldBeTooFastStopsWithAnError) {
  MC_GearIn gear;
  gear.RatioNumerator = 3.0;
  gear.Acceleration = gear.Deceleration = 1e6;
  other.configuration().max_velocity = 2000.0;
  program([&] {
    run(axis);
    gear(axis, other);
  });
  run.Execute = gear.Execute = true;
  controller.run_for(500ms);
  EXPECT_EQ(gear.ErrorID, ErrorId::above_limit);
  EXPECT_EQ(other.state(), AxisState::ErrorStop);
  EXPECT_EQ(other.commanded_velocity(), 0.0);
}

}  // namespace
}  // namespace plcopen_sequences_test
}  // namespace servodrome::master::plcopen
