#pragma once

#include <cstdint>

namespace servodrome::host::plcopen {

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

// What a function block wants of an axis, as far as the state diagram tells it apart.
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

// The state to which a command leads when it becomes active.
AxisState state_of(CommandKind kind);
// May the command be given in this state?
bool permitted(CommandKind kind, AxisState state);

}  // namespace servodrome::host::plcopen
