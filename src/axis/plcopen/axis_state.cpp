#include "axis/plcopen/axis_state.hpp"

namespace servodrome::master::plcopen {

const char* name(AxisState state) {
  switch (state) {
    case AxisState::Disabled: return "Disabled";
    case AxisState::Standstill: return "Standstill";
    case AxisState::Homing: return "Homing";
    case AxisState::Stopping: return "Stopping";
    case AxisState::DiscreteMotion: return "DiscreteMotion";
    case AxisState::ContinuousMotion: return "ContinuousMotion";
    case AxisState::SynchronizedMotion: return "SynchronizedMotion";
    case AxisState::ErrorStop: return "ErrorStop";
  }
  return "unknown";
}

AxisState state_of(CommandKind kind) {
  switch (kind) {
    case CommandKind::Home: return AxisState::Homing;
    case CommandKind::Stop: return AxisState::Stopping;
    case CommandKind::Halt:
    case CommandKind::MoveAbsolute:
    case CommandKind::MoveRelative:
    case CommandKind::MoveAdditive: return AxisState::DiscreteMotion;
    case CommandKind::MoveVelocity:
    case CommandKind::TorqueControl: return AxisState::ContinuousMotion;
    case CommandKind::GearIn:
    case CommandKind::CamIn: return AxisState::SynchronizedMotion;
  }
  return AxisState::ErrorStop;
}

// Figure 2 and its notes: in Stopping only another MC_Stop is permitted; Homing starts from Standstill only and ends by
// itself or by MC_Stop.
bool permitted(CommandKind kind, AxisState state) {
  switch (state) {
    case AxisState::Disabled:
    case AxisState::ErrorStop: return false;
    case AxisState::Stopping:
    case AxisState::Homing: return kind == CommandKind::Stop;
    case AxisState::Standstill: return true;
    case AxisState::DiscreteMotion:
    case AxisState::ContinuousMotion:
    case AxisState::SynchronizedMotion: return kind != CommandKind::Home;
  }
  return false;
}

}  // namespace servodrome::master::plcopen
