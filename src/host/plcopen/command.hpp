#pragma once

#include <memory>

#include "host/plcopen/axis_state.hpp"
#include "host/plcopen/cam_table.hpp"
#include "host/plcopen/error_id.hpp"

namespace servodrome::host::plcopen {

class Axis;

// MC_BUFFER_MODE (part 1, clause 2.4.2).
enum class BufferMode : std::uint8_t {
  Aborting,          // at once; what was active or buffered is aborted
  Buffered,          // when the command before it is done
  BlendingLow,       // the same, passing its target with the lower of both velocities,
  BlendingPrevious,  // with that of the command before,
  BlendingNext,      // with that of this command,
  BlendingHigh,      // with the higher
};

// MC_DIRECTION, for MC_MoveVelocity.
enum class Direction : std::uint8_t { Positive, Negative, Current };

// From which value of the master a slave is led (MC_SOURCE).
enum class Source : std::uint8_t { SetValue, ActualValue };

// What a function block gave to an axis, and what became of it. In the axis's units and seconds.
struct Command {
  enum class Status : std::uint8_t { buffered, active, done, aborted, failed };

  CommandKind kind = CommandKind::MoveAbsolute;
  BufferMode buffer_mode = BufferMode::Aborting;
  double position = 0.0;  // or distance
  double velocity = 0.0;
  double acceleration = 0.0;
  double deceleration = 0.0;
  double jerk = 0.0;  // 0: linear ramps
  Direction direction = Direction::Positive;

  double torque = 0.0;       // 0.1 % of rated torque
  double torque_ramp = 0.0;  // per second

  Axis* master = nullptr;
  Source source = Source::SetValue;
  double ratio = 1.0;
  std::shared_ptr<const CamTable> cam{};
  double master_offset = 0.0;
  double slave_offset = 0.0;
  double master_scaling = 1.0;
  double slave_scaling = 1.0;
  bool master_is_absolute = true;
  bool slave_is_absolute = true;

  Status status = Status::buffered;
  ErrorId error = ErrorId::none;
  bool in_goal = false;  // InVelocity, InTorque, InGear, InSync
  bool end_of_profile = false;
  bool released = false;  // MC_Stop: Execute is FALSE

  // ---- The axis's own ----
  double target_counts = 0.0;  // of a position command, when it is known
  bool is_placed = false;      // it is known

  bool is_over() const { return status == Status::done || status == Status::aborted || status == Status::failed; }
  bool goes_to_a_position() const {
    return kind == CommandKind::MoveAbsolute || kind == CommandKind::MoveRelative || kind == CommandKind::MoveAdditive;
  }
};

// MC_TouchProbe and the axis between them.
struct ProbeRequest {
  enum class Status : std::uint8_t { clearing, waiting, done, aborted };

  unsigned probe = 1;
  bool rising = true;
  bool window_only = false;
  double first_position = 0.0;  // units
  double last_position = 0.0;
  Status status = Status::clearing;
  double recorded_position = 0.0;
};

}  // namespace servodrome::host::plcopen
