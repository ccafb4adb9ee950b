// PLCopen programs with complete drives and motors, in virtual time: EtherCAT and CAN.
#include <cmath>
#include <gtest/gtest.h>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/plcopen/controller.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "ring_rig.hpp"

namespace servodrome::master::plcopen {
namespace plcopen_drives_test {
namespace {

using namespace std::chrono_literals;

// From here on positions are in revolutions.
constexpr double reference_counts = 131072.0;
constexpr double jmc_counts = 4000.0;

template <typename Block>
void set_dynamics(Block& block, double velocity) {
  block.Velocity = velocity;
  block.Acceleration = block.Deceleration = 20.0;
  block.Jerk = 500.0;
}

class Ring : public testing::Test, protected test::RingRig {
 protected:
  Ring() {
    set_up({.period = 1ms, .touch_probe = true});
    for (const auto& slave : slaves) slave->coe().write<std::int8_t>(0x6098, 0, 35);  // the present position is home
    operate(1ms);
    controller.emplace(*bus, std::array{AxisConfiguration{.counts_per_unit = reference_counts},
                                        AxisConfiguration{.counts_per_unit = jmc_counts}});
    power.Enable = true;
  }
  // Runs all blocks of a program in each cycle, after the axes have been enabled.
  void program(const std::function<void()>& body) {
    controller->on_cycle([this] { powers(); });
    ASSERT_TRUE(controller->run_until([this] { return power.Status && second_power.Status; }, 2s));
    controller->on_cycle([this, body] {
      powers();
      body();
    });
  }
  void powers() {
    power(x());
    second_power.Enable = power.Enable;
    second_power(y());
  }
  Axis& x() { return controller->axis(0); }
  Axis& y() { return controller->axis(1); }
  double true_turns(std::size_t axis, double counts) {
    return static_cast<double>(line.axes()[axis]->plant().position_counts()) / counts;
  }

  std::optional<Controller> controller;
  MC_Power power, second_power;
};

TEST_F(Ring, HomesMovesBlendsAndStops) {
  for (Axis* axis : {&x(), &y()}) {
    MC_Home home;
    MC_MoveAbsolute first, second;
    MC_MoveVelocity run;
    MC_Stop stop;
    home.Position = 1.0;
    first.Position = 3.0;
    second.Position = 5.0;
    set_dynamics(first, 4.0);
    set_dynamics(second, 2.0);
    set_dynamics(run, 1.5);
    second.Mode = BufferMode::BlendingLow;
    run.Direction = Direction::Negative;
    stop.Deceleration = 20.0;
    double at_first = -1.0;
    program([&] {
      home.Execute = true;
      home(*axis);
      first.Execute = second.Execute = home.Done;
      const bool was_active = second.Active;
      first(*axis);
      second(*axis);
      if (second.Active && !was_active) at_first = axis->commanded_velocity();
      if (second.Done) run.Execute = true;
      if (run.InVelocity && axis->actual_position() < 4.0) stop.Execute = true;
      stop(*axis);
      run(*axis);
    });
    const std::size_t number = axis == &x() ? 0 : 1;
    const double counts = number == 0 ? reference_counts : jmc_counts;
    ASSERT_TRUE(controller->run_until([&] { return home.Done; }, 5s)) << text_of(home.ErrorID);
    const double home_turns = true_turns(number, counts);
    ASSERT_TRUE(controller->run_until([&] { return second.Done; }, 10s)) << text_of(second.ErrorID);
    EXPECT_TRUE(first.Done);
    EXPECT_NEAR(at_first, 2.0, 0.03);
    controller->run_for(1ms);
    ASSERT_TRUE(controller->run_until([&] { return stop.Done; }, 10s)) << text_of(run.ErrorID);
    EXPECT_TRUE(run.CommandAborted);
    controller->run_for(500ms);
    // Compares the position of the shaft itself, not the drive's value.
    EXPECT_NEAR(true_turns(number, counts) - home_turns, axis->commanded_position() - 1.0, 0.003);
    EXPECT_EQ(axis->state(), AxisState::Stopping);
  }
  EXPECT_EQ(bus->counters().missed, 0U);
}

TEST_F(Ring, ASlaveIsGearedToItsMasterAxis) {
  MC_MoveVelocity run;
  MC_GearIn gear;
  MC_Stop stop;
  set_dynamics(run, 2.0);
  gear.RatioNumerator = 1.0;
  gear.RatioDenominator = -2.0;
  gear.Acceleration = gear.Deceleration = 50.0;
  stop.Deceleration = 20.0;
  program([&] {
    run.Execute = gear.Execute = true;
    stop(x());
    run(x());
    gear(x(), y());
  });
  ASSERT_TRUE(controller->run_until([&] { return gear.InGear && run.InVelocity; }, 2s));
  const double x_begin = true_turns(0, reference_counts);
  const double y_begin = true_turns(1, jmc_counts);
  controller->run_for(3s);
  stop.Execute = true;
  ASSERT_TRUE(controller->run_until([&] { return stop.Done; }, 2s));
  controller->run_for(500ms);
  const double way = true_turns(0, reference_counts) - x_begin;
  EXPECT_GT(way, 6.0);
  // Positions of the shafts themselves. At the start the slave's loop lags by a few hundredths of a revolution.
  EXPECT_NEAR(true_turns(1, jmc_counts) - y_begin, -0.5 * way, 0.06);
  EXPECT_NEAR(y().actual_velocity(), 0.0, 0.05);
  EXPECT_EQ(y().state(), AxisState::SynchronizedMotion);
}

TEST_F(Ring, TorqueAndAFaultThatIsReset) {
  MC_TorqueControl torque;
  MC_Reset reset;
  MC_ReadAxisError error;
  torque.Torque = 40.0;
  torque.TorqueRamp = 200.0;
  torque.Velocity = 5.0;
  error.Enable = true;
  program([&] {
    torque.Execute = true;
    torque(x());
    reset(x());
    error(x());
  });
  ASSERT_TRUE(controller->run_until([&] { return torque.InTorque; }, 2s));
  controller->run_for(2s);
  EXPECT_GT(x().actual_velocity(), 2.0);
  EXPECT_LT(x().actual_velocity(), 5.2);
  line.axes()[0]->inject(drive::Cause::over_voltage, true);
  controller->run_for(100ms);
  EXPECT_EQ(torque.ErrorID, ErrorId::drive_fault);
  EXPECT_EQ(error.DriveErrorCode, 0x3210);
  EXPECT_EQ(x().state(), AxisState::ErrorStop);
  reset.Execute = true;
  controller->run_for(2500ms);
  EXPECT_EQ(reset.ErrorID, ErrorId::reset_failed) << "its cause is still there";
  reset.Execute = false;
  line.axes()[0]->inject(drive::Cause::over_voltage, false);
  controller->run_for(2ms);
  reset.Execute = true;
  ASSERT_TRUE(controller->run_until([&] { return reset.Done; }, 2s)) << text_of(reset.ErrorID);
  ASSERT_TRUE(controller->run_until([&] { return x().state() == AxisState::Standstill; }, 2s));
}

TEST_F(Ring, TouchProbeLatchesWhereTheInputRose) {
  MC_MoveVelocity run;
  MC_TouchProbe probe;
  set_dynamics(run, 3.0);
  program([&] {
    run.Execute = true;
    run(x());
    probe.Execute = run.InVelocity;
    probe(x());
  });
  ASSERT_TRUE(controller->run_until([&] { return run.InVelocity; }, 2s));
  controller->run_for(500ms);
  EXPECT_TRUE(probe.Busy) << text_of(probe.ErrorID);
  const double before = x().actual_position();
  for (int wire = 0; wire < 8; ++wire) line.axes()[0]->force_input(wire, false);
  controller->run_for(20ms);
  const double at = x().actual_position();
  for (int wire = 3; wire < 8; ++wire) line.axes()[0]->force_input(wire, true);
  ASSERT_TRUE(controller->run_until([&] { return probe.Done; }, 1s)) << text_of(probe.ErrorID);
  EXPECT_GT(probe.RecordedPosition, before);
  EXPECT_NEAR(probe.RecordedPosition, at, 0.03) << "3 turns/s, filtered by some ms";
  EXPECT_LT(probe.RecordedPosition, x().actual_position());
}

// The same blocks over CAN, with a drive that has only cyclic synchronous position.
TEST(CanAxes, RunTheSameProgram) {
  line::Line line{line::test::settings_of(R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "ismc"
product = "ismc"
node = 1
[[axis]]
name = "reference"
product = "generic402"
node = 2
)")};
  Bus can{std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line};
  can.run_for(500ms);
  for (const auto node : std::array<std::uint8_t, 2>{1, 2}) SdoClient(can, node).write<std::int8_t>(0x6098, 0, 35);
  CanCyclicBus bus(can, {synchronous_position_drive(1), synchronous_position_drive(2)}, {.period = 2ms});
  const std::array configuration{AxisConfiguration{.counts_per_unit = 131072.0}};
  Controller controller(bus, configuration);
  std::array<MC_Power, 2> power;
  std::array<MC_Home, 2> home;
  std::array<MC_MoveAbsolute, 2> there;
  std::array<MC_MoveRelative, 2> back;
  bool done = false;
  controller.on_cycle([&] {
    done = true;
    for (std::size_t i = 0; i < 2; ++i) {
      Axis& axis = controller.axis(i);
      power[i].Enable = true;
      power[i](axis);
      home[i].Execute = power[i].Status;
      home[i](axis);
      there[i].Position = 2.0;
      back[i].Distance = -1.0;
      back[i].Mode = BufferMode::Buffered;
      set_dynamics(there[i], 4.0);
      set_dynamics(back[i], 4.0);
      there[i].Execute = back[i].Execute = home[i].Done;
      there[i](axis);
      back[i](axis);
      done = done && back[i].Done;
    }
  });
  ASSERT_TRUE(controller.run_until([&] { return done; }, 20s))
      << text_of(home[0].ErrorID) << ", " << text_of(back[0].ErrorID) << ", " << text_of(home[1].ErrorID) << ", "
      << text_of(back[1].ErrorID);
  controller.run_for(500ms);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(controller.axis(i).actual_position(), 1.0, 0.001) << i;
  // A drive without the mode returns an error.
  MC_TorqueControl torque;
  torque.Torque = 10.0;
  torque.TorqueRamp = 100.0;
  torque.Execute = true;
  torque(controller.axis(0));
  EXPECT_EQ(torque.ErrorID, ErrorId::not_mapped);
  controller.shut_down(20.0);
  EXPECT_EQ(controller.axis(0).motion().axis().state(), PowerState::switch_on_disabled);
}

}  // namespace
}  // namespace plcopen_drives_test
}  // namespace servodrome::master::plcopen
