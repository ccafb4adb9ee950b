#pragma once

#include <cstdint>

namespace servodrome::master::plcopen {

// The states of an axis (PLCopen Motion Control part 1, version 2.0, figure 2).
enum class AxisState : std::uint8_t {
  Disabled,
  Standstill,
  Homing,
  Stopping,
  DiscreteMotion,
  ContinuousMotion,
  SynchronizedMotion,
  ErrorStop,
};
const char* name(AxisState state);

// Kinds of command that the state diagram distinguishes.
enum class CommandKind : std::uint8_t {
  Home,
  Stop,
  Halt,
  MoveAbsolute,
  MoveRelative,
  MoveAdditive,
  MoveVelocity,
  TorqueControl,
  GearIn,
  CamIn,
};

// The state that a command enters when it becomes active.
AxisState state_of(CommandKind kind);
// True if the command is permitted in this state.
bool permitted(CommandKind kind, AxisState state);

}  // namespace servodrome::master::plcopen
