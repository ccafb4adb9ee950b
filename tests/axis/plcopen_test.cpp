// Function blocks on drives without control loops, cycle by cycle: the timing diagrams of PLCopen Motion Control part
// 1, version 2.0, clause 2.4, as text. Each character is one cycle.
#include <cmath>
#include <gtest/gtest.h>

#include "axis/plcopen/controller.hpp"
#include "axis/simulated_drives.hpp"

namespace servodrome::master::plcopen {
namespace plcopen_test {
namespace {

using namespace std::chrono_literals;
using test::SimulatedBus;

// Compares the outputs for given inputs with the diagram: '#' TRUE, '_' FALSE.
class Diagram {
 public:
  void input(bool& variable, std::string drawn) {
    length_ = std::max(length_, drawn.size());
    inputs_.push_back({&variable, std::move(drawn)});
  }
  void output(const char* name, const bool& variable, const char* expected) {
    outputs_.push_back({name, &variable, expected, {}});
  }
  void run(Controller& controller, const std::function<void()>& program) {
    for (std::size_t cycle = 0; cycle < length_; ++cycle) {
      for (auto& [variable, drawn] : inputs_) *variable = cycle < drawn.size() && drawn[cycle] == '#';
      controller.on_cycle(program);
      controller.run_for(controller.bus().period());
      for (Output& output : outputs_) output.came += *output.variable ? '#' : '_';
    }
    for (const Output& output : outputs_) EXPECT_EQ(output.came, output.expected) << output.name;
  }

 private:
  struct Output {
    const char* name;
    const bool* variable;
    std::string expected;
    std::string came;
  };
  std::vector<std::pair<bool*, std::string>> inputs_;
  std::vector<Output> outputs_;
  std::size_t length_ = 0;
};

class Blocks : public testing::Test {
 protected:
  SimulatedBus bus{2};
  Controller controller{bus};
  Axis& axis = controller.axis(0);
  Axis& other = controller.axis(1);
  MC_Power power, other_power;

  void SetUp() override {
    power.Enable = other_power.Enable = true;
    controller.on_cycle([&] { powers(); });
    ASSERT_TRUE(controller.run_until([&] { return power.Status && other_power.Status; }, 1s));
  }
  void powers() {
    power(axis);
    other_power(other);
  }
  // One count per cycle, with practically no acceleration time.
  template <typename Block>
  static void set_dynamics(Block& block, double velocity = 1000.0) {
    block.Velocity = velocity;
    block.Acceleration = block.Deceleration = 1e9;
  }
  std::string states;
  // Appends the letter of the state; called at the end of the program in each cycle.
  void note_state() { states += "DSHPMCYE"[letter_of(axis.state())]; }
  static std::size_t letter_of(AxisState state) {
    switch (state) {
      case AxisState::Disabled: return 0;
      case AxisState::Standstill: return 1;
      case AxisState::Homing: return 2;
      case AxisState::Stopping: return 3;
      case AxisState::DiscreteMotion: return 4;
      case AxisState::ContinuousMotion: return 5;
      case AxisState::SynchronizedMotion: return 6;
      case AxisState::ErrorStop: return 7;
    }
    return 0;
  }
};

// ---- Clause 2.4.1: Execute, Done, Busy ----

// The diagrams are aligned in columns.
// clang-format off

TEST_F(Blocks, DoneStaysUntilExecuteFalls) {
  MC_MoveAbsolute move;
  move.Position = 3.0;
  set_dynamics(move);
  Diagram diagram;
  diagram.input(move.Execute,                  "_########___##_");
  diagram.output("Busy", move.Busy,            "_####_______#__");
  diagram.output("Active", move.Active,        "_####_______#__");
  diagram.output("Done", move.Done,            "_____####____#_");
  diagram.output("Error", move.Error,          "_______________");
  diagram.run(controller, [&] {
    powers();
    // At the second edge the axis is at its target already: a move of length 0 is done in the next cycle.
    move(axis);
    note_state();
  });
  EXPECT_EQ(states,                            "SMMMMSSSSSSSMSS");
}

TEST_F(Blocks, DoneIsThereForACycleWhenExecuteFellBefore) {
  MC_MoveAbsolute move;
  move.Position = 3.0;
  set_dynamics(move);
  Diagram diagram;
  diagram.input(move.Execute,                  "_#___________");
  diagram.output("Busy", move.Busy,            "_####________");
  diagram.output("Done", move.Done,            "_____#_______");
  diagram.run(controller, [&] {
    powers();
    move(axis);
  });
}

TEST_F(Blocks, ErrorOfAnInputStaysWithExecute) {
  MC_MoveAbsolute move;
  move.Position = 3.0;  // the velocity is missing
  Diagram diagram;
  diagram.input(move.Execute,                  "_###___#___");
  diagram.output("Busy", move.Busy,            "___________");
  diagram.output("Done", move.Done,            "___________");
  diagram.output("Error", move.Error,          "_###___#___");
  diagram.run(controller, [&] {
    powers();
    move(axis);
    note_state();
  });
  EXPECT_EQ(states,                            "SSSSSSSSSSS") << "an error of a block is none of the axis";
}

// Figure of the standard: the second block aborts the first.
TEST_F(Blocks, AbortingTakesTheAxis) {
  MC_MoveAbsolute first, second;
  first.Position = 100.0;
  second.Position = 6.0;
  set_dynamics(first);
  set_dynamics(second);
  Diagram diagram;
  diagram.input(first.Execute,                      "_######______");
  diagram.input(second.Execute,                     "____######___");
  diagram.output("first.Busy", first.Busy,          "_###_________");
  diagram.output("first.Aborted", first.CommandAborted, "____###______");
  diagram.output("first.Done", first.Done,          "_____________");
  diagram.output("second.Busy", second.Busy,        "____####_____");
  diagram.output("second.Done", second.Done,        "________##___");
  diagram.run(controller, [&] {
    powers();
    // A block that is called after the one that aborts it shows CommandAborted in the same cycle.
    second(axis);
    first(axis);
  });
  EXPECT_EQ(axis.commanded_position(), 6.0);
}

// A second edge of the same block while it is busy: the block then shows the new command.
TEST_F(Blocks, ASecondEdgeTakesNewInputs) {
  MC_MoveAbsolute move;
  move.Position = 100.0;
  set_dynamics(move);
  Diagram diagram;
  diagram.input(move.Execute,                  "_##_#_________");
  diagram.output("Busy", move.Busy,            "_######_______");
  diagram.output("Aborted", move.CommandAborted, "______________");
  diagram.output("Done", move.Done,            "_______#______");
  int cycle = 0;
  diagram.run(controller, [&] {
    powers();
    if (++cycle == 5) move.Position = 5.0;
    move(axis);
  });
  EXPECT_EQ(axis.commanded_position(), 5.0);
}

// ---- Clause 2.4.2: buffer modes ----

TEST_F(Blocks, BufferedBecomesActiveWhenTheFirstIsDone) {
  MC_MoveAbsolute first;
  MC_MoveRelative second;
  first.Position = 4.0;
  second.Distance = 3.0;
  second.Mode = BufferMode::Buffered;
  set_dynamics(first);
  set_dynamics(second);
  Diagram diagram;
  diagram.input(first.Execute,                      "_##########____");
  diagram.input(second.Execute,                     "__##########___");
  diagram.output("first.Busy", first.Busy,          "_#####_________");
  diagram.output("first.Active", first.Active,      "_#####_________");
  diagram.output("first.Done", first.Done,          "______#####____");
  diagram.output("second.Busy", second.Busy,        "__#######______");
  diagram.output("second.Active", second.Active,    "______###______");
  diagram.output("second.Done", second.Done,        "_________###___");
  diagram.run(controller, [&] {
    powers();
    first(axis);
    second(axis);
  });
  EXPECT_EQ(axis.commanded_position(), 7.0);
}

// clang-format on

struct BlendingCase {
  const char* name;
  BufferMode mode;
  double second_velocity;
  double second_target;
  double expected;  // velocity at the first target
};

class Blending : public Blocks, public testing::WithParamInterface<BlendingCase> {};
INSTANTIATE_TEST_SUITE_P(Modes, Blending,
                         testing::Values(BlendingCase{"Buffered", BufferMode::Buffered, 40.0, 400.0, 0.0},
                                         BlendingCase{"LowIsTheSecond", BufferMode::BlendingLow, 40.0, 400.0, 40.0},
                                         BlendingCase{"LowIsTheFirst", BufferMode::BlendingLow, 250.0, 400.0, 100.0},
                                         BlendingCase{"Previous", BufferMode::BlendingPrevious, 40.0, 400.0, 100.0},
                                         BlendingCase{"Next", BufferMode::BlendingNext, 40.0, 400.0, 40.0},
                                         BlendingCase{"High", BufferMode::BlendingHigh, 40.0, 400.0, 100.0},
                                         // Reversal: the axis stops in between.
                                         BlendingCase{"Reversal", BufferMode::BlendingHigh, 40.0, 0.0, 0.0},
                                         // 2 counts to stop at 400/s^2: sqrt(2 * 400 * 2).
                                         BlendingCase{"TooShort", BufferMode::BlendingHigh, 100.0, 202.0, 40.0}),
                         [](const auto& one) { return one.param.name; });

// The axis passes the first target at exactly the velocity that the mode demands, and reaches the second without
// overshoot.
TEST_P(Blending, PassesTheFirstTargetAtTheModesVelocity) {
  MC_MoveAbsolute first, second;
  first.Position = 200.0;
  first.Velocity = 100.0;
  second.Position = GetParam().second_target;
  second.Velocity = GetParam().second_velocity;
  first.Acceleration = first.Deceleration = second.Acceleration = second.Deceleration = 400.0;
  second.Mode = GetParam().mode;
  double at_target = -1.0;
  double greatest = 0.0;
  double before = 0.0;
  bool was_active = false;
  controller.on_cycle([&] {
    powers();
    first.Execute = true;
    second.Execute = axis.commanded_position() > 50.0 || second.Busy || second.Done;
    first(axis);
    second(axis);
    if (second.Active && !was_active) at_target = axis.commanded_velocity();
    was_active = second.Active;
    EXPECT_LT(std::abs(axis.commanded_velocity() - before), 400.0 * 0.001 * 1.01) << "a jump of the velocity";
    before = axis.commanded_velocity();
    greatest = std::max(greatest, axis.commanded_position());
  });
  ASSERT_TRUE(controller.run_until([&] { return second.Done; }, 30s));
  EXPECT_TRUE(first.Done);
  // At most one cycle after the target.
  EXPECT_NEAR(std::abs(at_target), GetParam().expected, 400.0 * 0.001);
  EXPECT_EQ(axis.commanded_position(), GetParam().second_target);
  EXPECT_LE(greatest, std::max(200.0, GetParam().second_target) + 1e-9);
}

TEST_F(Blocks, AChainOfBlendsIsAsFastAsItsEndAllows) {
  std::array<MC_MoveRelative, 4> moves;
  for (MC_MoveRelative& move : moves) {
    move.Distance = 10.0;
    move.Velocity = 1000.0;
    move.Acceleration = move.Deceleration = 1000.0;
    move.Mode = BufferMode::BlendingNext;
  }
  std::array<double, 4> begins{};
  std::array<bool, 4> active{};
  controller.on_cycle([&] {
    powers();
    for (std::size_t i = 0; i < moves.size(); ++i) {
      moves[i].Execute = true;
      moves[i](axis);
      if (moves[i].Active && !active[i]) begins[i] = axis.commanded_velocity();
      active[i] = moves[i].Active;
    }
  });
  ASSERT_TRUE(controller.run_until([&] { return moves[3].Done; }, 5s));
  EXPECT_EQ(axis.commanded_position(), 40.0);
  // Accelerates to the middle and decelerates again: sqrt(2 a s) for 10, 20 and 10 counts.
  EXPECT_NEAR(begins[1], std::sqrt(2.0 * 1000.0 * 10.0), 1.1);
  EXPECT_NEAR(begins[2], std::sqrt(2.0 * 1000.0 * 20.0), 1.1);
  EXPECT_NEAR(begins[3], std::sqrt(2.0 * 1000.0 * 10.0), 1.1);
}

TEST_F(Blocks, TooManyBufferedCommandsAreRefused) {
  std::vector<MC_MoveRelative> moves(Axis::most_buffered + 2);
  controller.on_cycle([&] {
    powers();
    for (MC_MoveRelative& move : moves) {
      move.Distance = 1000.0;
      move.Mode = BufferMode::Buffered;
      set_dynamics(move);
      move.Execute = true;
      move(axis);
    }
  });
  controller.run_for(1ms);
  EXPECT_TRUE(moves.front().Active);
  EXPECT_TRUE(moves[Axis::most_buffered].Busy);
  EXPECT_EQ(moves.back().ErrorID, ErrorId::queue_full);
}

// ---- The other motions ----

// clang-format off
TEST_F(Blocks, VelocityGoesOnWhenExecuteFalls) {
  MC_MoveVelocity run;
  MC_Halt halt;
  set_dynamics(run);
  run.Acceleration = run.Deceleration = halt.Deceleration = 500'000.0;  // two cycles
  Diagram diagram;
  diagram.input(run.Execute,                        "_#####________");
  diagram.input(halt.Execute,                       "________#_____");
  diagram.output("run.Busy", run.Busy,              "_#####________");
  diagram.output("run.InVelocity", run.InVelocity,  "___###________");
  diagram.output("run.Aborted", run.CommandAborted, "______________");
  diagram.output("halt.Busy", halt.Busy,            "________##____");
  diagram.output("halt.Done", halt.Done,            "__________#___");
  diagram.run(controller, [&] {
    powers();
    halt(axis);
    run(axis);
    note_state();
  });
  EXPECT_EQ(states,                                 "SCCCCCCCMMSSSS");
}

TEST_F(Blocks, StopHoldsTheAxisWhileExecuteIsTrue) {
  MC_MoveVelocity run;
  MC_Stop stop;
  MC_MoveRelative move;
  set_dynamics(run);
  set_dynamics(move);
  stop.Deceleration = 500'000.0;
  move.Distance = 1.0;
  Diagram diagram;
  diagram.input(run.Execute,                        "_###############");
  diagram.input(stop.Execute,                       "____######______");
  diagram.input(move.Execute,                       "_______##____#__");
  diagram.output("run.Aborted", run.CommandAborted, "____############");
  diagram.output("stop.Busy", stop.Busy,            "____##__________");
  diagram.output("stop.Done", stop.Done,            "______####______");
  diagram.output("move.Error", move.Error,          "_______##_______");
  diagram.output("move.Busy", move.Busy,            "_____________##_");
  diagram.run(controller, [&] {
    powers();
    stop(axis);
    run(axis);
    move(axis);
    note_state();
  });
  EXPECT_EQ(states,                                 "SCCCPPPPPPPSSMMS");
}

// clang-format on

TEST_F(Blocks, AdditiveAddsToATargetThatWasNotReached) {
  MC_MoveAbsolute move;
  MC_MoveAdditive add;
  move.Position = 100.0;
  add.Distance = 50.0;
  set_dynamics(move);
  set_dynamics(add);
  controller.on_cycle([&] {
    powers();
    move.Execute = true;
    move(axis);
    add.Execute = axis.commanded_position() > 30.0;
    add(axis);
  });
  ASSERT_TRUE(controller.run_until([&] { return add.Done; }, 1s));
  EXPECT_EQ(axis.commanded_position(), 150.0);
  EXPECT_TRUE(move.CommandAborted);
}

TEST_F(Blocks, HomeGivesThePosition) {
  MC_Home home;
  home.Position = 77.0;
  controller.on_cycle([&] {
    powers();
    home.Execute = true;
    home(axis);
    note_state();
  });
  ASSERT_TRUE(controller.run_until([&] { return home.Done; }, 1s));
  EXPECT_EQ(states.substr(0, 3), "HHH");
  EXPECT_EQ(states.back(), 'S');
  EXPECT_EQ(axis.commanded_position(), 77.0);
  EXPECT_EQ(bus.drive(0).position, 0);
  EXPECT_TRUE(axis.is_homed());
}

TEST_F(Blocks, StopBreaksHomingOff) {
  MC_Home home;
  MC_Stop stop;
  bus.drive(0).homing_cycles = 1'000'000;
  stop.Deceleration = 1000.0;
  controller.on_cycle([&] {
    powers();
    home.Execute = true;
    stop.Execute = controller.bus().now() > 200ms;
    stop(axis);
    home(axis);
  });
  ASSERT_TRUE(controller.run_until([&] { return stop.Done; }, 1s));
  EXPECT_TRUE(home.CommandAborted);
  EXPECT_FALSE(axis.is_homed());
  EXPECT_EQ(axis.state(), AxisState::Stopping);
}

TEST_F(Blocks, TorqueReportsWhenItIsThere) {
  MC_TorqueControl torque;
  torque.Torque = 50.0;
  torque.TorqueRamp = 1000.0;
  controller.on_cycle([&] {
    powers();
    torque.Execute = true;
    torque(axis);
  });
  controller.run_for(30ms);
  EXPECT_FALSE(torque.InTorque);
  controller.run_for(30ms);
  EXPECT_TRUE(torque.InTorque && torque.Active);
  EXPECT_EQ(axis.state(), AxisState::ContinuousMotion);
}

TEST_F(Blocks, TheSameTorqueInTheOtherDirectionIsNotTheTorque) {
  MC_TorqueControl torque, opposite;
  torque.Torque = -80.0;
  opposite.Torque = 50.0;
  torque.TorqueRamp = opposite.TorqueRamp = 1000.0;
  controller.on_cycle([&] {
    powers();
    torque.Execute = true;
    torque(axis);
    opposite(axis);
  });
  ASSERT_TRUE(controller.run_until([&] { return torque.InTorque; }, 1s));
  opposite.Execute = true;
  for (int cycle = 0; cycle < 120; ++cycle) {
    controller.run_for(1ms);
    ASSERT_FALSE(opposite.InTorque) << cycle;
  }
  controller.run_for(30ms);
  EXPECT_TRUE(opposite.InTorque);
  EXPECT_EQ(bus.drive(0).output({0x6071, 0})->get<std::int16_t>(), 50);
}

// ---- Power, errors, reset ----

TEST_F(Blocks, PowerOffAbortsAndDisables) {
  MC_MoveVelocity run;
  set_dynamics(run);
  run.Execute = true;
  controller.on_cycle([&] {
    powers();
    run(axis);
  });
  controller.run_for(5ms);
  power.Enable = false;
  controller.run_for(5ms);
  EXPECT_TRUE(run.CommandAborted);
  EXPECT_FALSE(power.Status);
  EXPECT_EQ(axis.state(), AxisState::Disabled);
  EXPECT_EQ(bus.drive(0).state, PowerState::switch_on_disabled);
  run.Execute = false;
  controller.run_for(2ms);
  run.Execute = true;
  controller.run_for(1ms);
  EXPECT_EQ(run.ErrorID, ErrorId::state_does_not_permit);
}

TEST_F(Blocks, AFaultIsErrorStopUntilReset) {
  MC_MoveVelocity run;
  MC_Reset reset;
  MC_ReadStatus status;
  MC_ReadAxisError axis_error;
  set_dynamics(run);
  status.Enable = axis_error.Enable = run.Execute = true;
  controller.on_cycle([&] {
    powers();
    reset(axis);
    run(axis);
    status(axis);
    axis_error(axis);
  });
  controller.run_for(5ms);
  EXPECT_TRUE(status.ContinuousMotion);
  bus.drive(0).break_down(0x3210);
  controller.run_for(2ms);
  EXPECT_TRUE(status.ErrorStop && !status.ContinuousMotion);
  EXPECT_EQ(run.ErrorID, ErrorId::drive_fault);
  EXPECT_EQ(axis_error.AxisErrorID, ErrorId::drive_fault);
  EXPECT_EQ(axis_error.DriveErrorCode, 0x3210);
  EXPECT_EQ(power.ErrorID, ErrorId::drive_fault);
  run.Execute = false;
  controller.run_for(2ms);
  run.Execute = true;
  controller.run_for(1ms);
  EXPECT_EQ(run.ErrorID, ErrorId::state_does_not_permit);
  reset.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return reset.Done; }, 1s));
  ASSERT_TRUE(controller.run_until([&] { return status.Standstill; }, 1s)) << "MC_Power is still enabled";
  EXPECT_EQ(axis_error.AxisErrorID, ErrorId::none);
}

TEST_F(Blocks, LagMonitoringStopsTheAxis) {
  axis.configuration().enable_lag_monitoring = true;
  axis.configuration().max_position_lag = 20.0;
  MC_MoveVelocity run;
  set_dynamics(run);
  run.Execute = true;
  controller.on_cycle([&] {
    powers();
    run(axis);
  });
  controller.run_for(50ms);
  EXPECT_TRUE(run.InVelocity);
  bus.drive(0).is_blocked = true;
  controller.run_for(50ms);
  EXPECT_EQ(run.ErrorID, ErrorId::following_error);
  EXPECT_EQ(axis.state(), AxisState::ErrorStop);
}

// ---- Limits and parameters ----

TEST_F(Blocks, SoftwareLimitsRefuseTargetsAndStopRuns) {
  MC_WriteParameter limit;
  MC_WriteBoolParameter enable;
  limit.ParameterNumber = Parameter::SWLimitPos;
  limit.Value = 100.0;
  enable.ParameterNumber = Parameter::EnableLimitPos;
  enable.Value = limit.Execute = enable.Execute = true;
  MC_MoveAbsolute move;
  MC_MoveVelocity run;
  move.Position = 101.0;
  set_dynamics(move);
  set_dynamics(run);
  run.Acceleration = run.Deceleration = 20'000.0;
  controller.on_cycle([&] {
    powers();
    limit(axis);
    enable(axis);
    move(axis);
    run(axis);
  });
  controller.run_for(1ms);
  EXPECT_TRUE(limit.Done && enable.Done);
  move.Execute = true;
  controller.run_for(1ms);
  EXPECT_EQ(move.ErrorID, ErrorId::beyond_software_limit);
  run.Execute = true;
  controller.run_for(2s);
  EXPECT_EQ(run.ErrorID, ErrorId::software_limit_reached);
  EXPECT_EQ(axis.state(), AxisState::ErrorStop);
  EXPECT_NEAR(axis.commanded_position(), 100.0, 1.1) << "at rest where the limit is, a cycle's way at most";
  EXPECT_EQ(axis.commanded_velocity(), 0.0);
}

TEST_F(Blocks, ParametersAreReadWrittenAndRefused) {
  double value = 0.0;
  bool flag = true;
  EXPECT_EQ(write_parameter(axis, Parameter::MaxVelocityAppl, 500.0), ErrorId::none);
  EXPECT_EQ(read_parameter(axis, Parameter::MaxVelocityAppl, value), ErrorId::none);
  EXPECT_EQ(value, 500.0);
  EXPECT_EQ(write_parameter(axis, Parameter::MaxVelocityAppl, -1.0), ErrorId::parameter_invalid);
  EXPECT_EQ(write_parameter(axis, Parameter::MaxVelocityAppl, std::nan("")), ErrorId::parameter_invalid);
  EXPECT_EQ(write_parameter(axis, Parameter::MaxVelocitySystem, 1.0), ErrorId::parameter_is_read_only);
  EXPECT_EQ(write_parameter(axis, Parameter::ActualVelocity, 1.0), ErrorId::parameter_is_read_only);
  EXPECT_EQ(write_parameter(axis, Parameter{99}, 1.0), ErrorId::no_such_parameter);
  EXPECT_EQ(read_parameter(axis, Parameter::EnableLimitNeg, flag), ErrorId::none);
  EXPECT_FALSE(flag);
  EXPECT_EQ(read_parameter(axis, Parameter::SWLimitNeg, flag), ErrorId::no_such_parameter);
  MC_MoveVelocity run;
  set_dynamics(run, 501.0);
  run.Execute = true;
  run(axis);
  EXPECT_EQ(run.ErrorID, ErrorId::above_limit);
}

TEST_F(Blocks, SetPositionMovesNothing) {
  MC_MoveVelocity run;
  MC_SetPosition set;
  set_dynamics(run);
  set.Position = 5000.0;
  run.Execute = true;
  controller.on_cycle([&] {
    powers();
    run(axis);
    set(axis);
  });
  controller.run_for(20ms);
  set.Execute = true;
  controller.run_for(1ms);
  EXPECT_TRUE(set.Done);
  controller.run_for(100ms);
  EXPECT_NEAR(axis.actual_position(), 5100.0, 2.0);
  EXPECT_NEAR(static_cast<double>(bus.drive(0).position), 120.0, 3.0);
}

// ---- Clause 2.4.1: Enable, Valid, Busy, Error ----

// clang-format off

TEST_F(Blocks, ReadingBlocksAreValidAsLongAsTheyAreEnabled) {
  MC_ReadActualPosition position;
  MC_ReadActualVelocity velocity;
  MC_ReadActualTorque torque;
  MC_ReadParameter number;
  MC_ReadBoolParameter yes;
  Diagram diagram;
  diagram.input(position.Enable,         "_###__#_");
  diagram.input(velocity.Enable,         "__##____");
  diagram.input(torque.Enable,           "_#_#_#__");
  diagram.input(number.Enable,           "_####___");
  diagram.input(yes.Enable,              "___####_");
  diagram.output("Valid", position.Valid, "_###__#_");
  diagram.output("Busy", position.Busy,   "_###__#_");
  diagram.output("Valid", velocity.Valid, "__##____");
  diagram.output("Valid", torque.Valid,   "_#_#_#__");
  diagram.output("Valid", number.Valid,   "_####___");
  diagram.output("Error", number.Error,   "________");
  diagram.output("Valid", yes.Valid,      "___####_");
  diagram.run(controller, [&] {
    powers();
    position(axis);
    velocity(axis);
    torque(axis);
    number(axis);
    yes(axis);
  });
}

TEST_F(Blocks, AParameterThatIsNotThereIsAnErrorWhileItIsEnabled) {
  MC_ReadParameter number;
  number.ParameterNumber = static_cast<Parameter>(999);
  Diagram diagram;
  diagram.input(number.Enable,         "_###_");
  diagram.output("Valid", number.Valid, "_____");
  diagram.output("Busy", number.Busy,   "_____");
  diagram.output("Error", number.Error, "_###_");
  diagram.run(controller, [&] {
    powers();
    number(axis);
  });
  EXPECT_EQ(number.ErrorID, ErrorId::none) << "no longer enabled";
}

// clang-format on

TEST_F(Blocks, ReadingBlocksReadWhatTheAxisDoes) {
  MC_MoveVelocity run;
  set_dynamics(run, 1000.0);
  run.Execute = true;
  MC_ReadActualPosition position;
  MC_ReadActualVelocity velocity;
  MC_ReadParameter commanded;
  position.Enable = velocity.Enable = commanded.Enable = true;
  controller.on_cycle([&] {
    powers();
    run(axis);
    position(axis);
    velocity(axis);
    commanded(axis);
  });
  controller.run_for(500ms);
  EXPECT_NEAR(position.Position, static_cast<double>(bus.drive(0).position), 2.0);
  EXPECT_GT(position.Position, 400.0);
  EXPECT_NEAR(velocity.Velocity, 1000.0, 10.0);
  EXPECT_NEAR(commanded.Value, position.Position, 3.0);
}

// ---- Master and slave ----

TEST_F(Blocks, GearCouplesPositionsFromInGearOn) {
  MC_MoveVelocity run;
  MC_GearIn gear;
  MC_GearOut out;
  set_dynamics(run, 1000.0);
  run.Acceleration = run.Deceleration = 50'000.0;
  gear.RatioNumerator = -3.0;
  gear.RatioDenominator = 2.0;
  gear.Acceleration = gear.Deceleration = 100'000.0;
  run.Execute = true;
  double origin = 0.0;
  double worst = 0.0;
  bool coupled = false;
  controller.on_cycle([&] {
    powers();
    run(axis);
    gear(axis, other);
    out(other);
    if (gear.InGear) {
      const double difference = other.commanded_position() + 1.5 * axis.commanded_position();
      if (!coupled) origin = difference;
      coupled = true;
      worst = std::max(worst, std::abs(difference - origin));
    }
  });
  controller.run_for(100ms);
  gear.Execute = true;
  ASSERT_TRUE(controller.run_until([&] { return gear.InGear; }, 1s));
  EXPECT_EQ(other.state(), AxisState::SynchronizedMotion);
  run.Execute = false;
  controller.run_for(2ms);
  run.Velocity = 300.0;
  run.Execute = true;
  controller.run_for(1s);
  EXPECT_LT(worst, 1e-6) << "no count is lost, also while the master slows down";
  EXPECT_NEAR(other.commanded_velocity(), -450.0, 1e-6);
  out.Execute = true;
  controller.run_for(2ms);
  EXPECT_TRUE(out.Done && gear.CommandAborted);
  EXPECT_EQ(other.state(), AxisState::ContinuousMotion);
  controller.run_for(100ms);
  EXPECT_NEAR(other.commanded_velocity(), -450.0, 1e-6);
}

TEST_F(Blocks, CamLeadsTheSlave) {
  MC_MoveVelocity run;
  MC_CamIn cam;
  set_dynamics(run, 1000.0);
  run.Acceleration = run.Deceleration = 50'000.0;
  cam.CamTableID = std::make_shared<CamTable>(
      CamTable::through({{0.0, 0.0}, {100.0, 50.0}, {200.0, 0.0}, {300.0, -50.0}, {400.0, 0.0}}, true));
  run.Execute = cam.Execute = true;
  double worst = 0.0;
  int ends = 0;
  controller.on_cycle([&] {
    powers();
    cam(axis, other);
    run(axis);
    if (cam.InSync) {
      worst =
          std::max(worst, std::abs(cam.CamTableID->at(axis.commanded_position()).slave - other.commanded_position()));
    }
    if (cam.EndOfProfile) ++ends;
  });
  controller.run_for(2s);
  EXPECT_TRUE(cam.InSync);
  EXPECT_LT(worst, 1e-9);
  EXPECT_EQ(ends, 4) << "1990 counts of 400";
  // At another position it must not jump.
  MC_Halt halt;
  halt.Deceleration = 1e6;
  cam.Execute = false;
  controller.on_cycle([&] {
    powers();
    run(axis);
    cam(axis, other);
    halt.Execute = true;
    halt(other);
  });
  controller.run_for(250ms);
  EXPECT_EQ(other.state(), AxisState::Standstill);
  cam.Execute = true;
  controller.run_for(1ms);
  EXPECT_EQ(cam.ErrorID, ErrorId::not_on_the_cam);
  cam.Execute = false;
  cam.SlaveAbsolute = false;
  controller.run_for(2ms);
  cam.Execute = true;
  controller.run_for(3ms);
  EXPECT_TRUE(cam.InSync) << text_of(cam.ErrorID);
  // The axis leaves its cam and continues at the same velocity.
  MC_CamOut leave;
  leave.Execute = true;
  const double before = other.commanded_velocity();
  controller.on_cycle([&] {
    powers();
    run(axis);
    leave(other);
    cam(axis, other);
  });
  controller.run_for(5ms);
  EXPECT_TRUE(leave.Done);
  EXPECT_TRUE(cam.CommandAborted);
  EXPECT_EQ(other.state(), AxisState::ContinuousMotion);
  EXPECT_NEAR(other.commanded_velocity(), before, 5.0);
  EXPECT_NE(before, 0.0);
}

TEST_F(Blocks, AMasterMayNotFollowItsSlave) {
  MC_GearIn there, back;
  there.Acceleration = there.Deceleration = back.Acceleration = back.Deceleration = 1000.0;
  there.Execute = back.Execute = true;
  there(axis, other);
  back(other, axis);
  EXPECT_TRUE(there.Active);
  EXPECT_EQ(back.ErrorID, ErrorId::master_invalid);
  MC_GearIn self;
  self.Acceleration = self.Deceleration = 1000.0;
  self.Execute = true;
  self(axis, axis);
  EXPECT_EQ(self.ErrorID, ErrorId::master_invalid);
}

TEST(CamTable, IsCubicAndContinuous) {
  const CamTable cam({{0.0, 0.0, 0.0}, {2.0, 8.0, 12.0}, {3.0, 8.0, 0.0}});
  for (const double x : {0.1, 0.7, 1.9}) {
    EXPECT_NEAR(cam.at(x).slave, x * x * x, 1e-12);
    EXPECT_NEAR(cam.at(x).slope, 3 * x * x, 1e-12);
  }
  EXPECT_NEAR(cam.at(2.0).slope, 12.0, 1e-12);
  EXPECT_EQ(cam.at(-1.0).slave, 0.0);
  EXPECT_EQ(cam.at(9.0).slave, 8.0);
  EXPECT_FALSE(CamTable({{0.0, 0.0}}).valid());
  EXPECT_FALSE(CamTable({{1.0, 0.0}, {1.0, 2.0}}).valid());
}

// ---- Touch probe ----

TEST_F(Blocks, TouchProbeRecordsOnceAndCanBeAborted) {
  MC_TouchProbe probe;
  MC_AbortTrigger abort;
  probe.Execute = true;
  bus.drive(0).position = 0;
  controller.on_cycle([&] {
    powers();
    probe(axis);
    abort(axis);
  });
  controller.run_for(5ms);
  EXPECT_TRUE(probe.Busy);
  bus.drive(0).touch(false);
  controller.run_for(2ms);
  EXPECT_TRUE(probe.Busy) << "the other edge";
  bus.drive(0).touch(true);
  controller.run_for(2ms);
  EXPECT_TRUE(probe.Done);
  EXPECT_EQ(probe.RecordedPosition, axis.actual_position());
  probe.Execute = false;
  controller.run_for(2ms);
  probe.Execute = true;
  controller.run_for(5ms);
  EXPECT_TRUE(probe.Busy) << "armed anew: the last edge does not count";
  MC_TouchProbe second;
  second.Execute = true;
  second(axis);
  EXPECT_EQ(second.ErrorID, ErrorId::probe_in_use);
  abort.Execute = true;
  controller.run_for(2ms);
  EXPECT_TRUE(probe.CommandAborted && abort.Done);
}

TEST_F(Blocks, TouchProbeOutsideItsWindowDoesNotCount) {
  MC_TouchProbe probe;
  MC_MoveVelocity run;
  set_dynamics(run);
  probe.WindowOnly = probe.Execute = run.Execute = true;
  probe.FirstPosition = 100.0;
  probe.LastPosition = 200.0;
  controller.on_cycle([&] {
    powers();
    run(axis);
    probe(axis);
  });
  controller.run_for(50ms);
  bus.drive(0).touch(true);
  controller.run_for(100ms);
  EXPECT_TRUE(probe.Busy);
  bus.drive(0).touch(true);
  controller.run_for(2ms);
  EXPECT_TRUE(probe.Done);
  EXPECT_NEAR(probe.RecordedPosition, 149.0, 3.0);
}

}  // namespace
}  // namespace plcopen_test
}  // namespace servodrome::master::plcopen
