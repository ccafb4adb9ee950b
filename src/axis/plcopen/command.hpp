#pragma once

#include <memory>

#include "axis/plcopen/axis_state.hpp"
#include "axis/plcopen/cam_table.hpp"
#include "axis/plcopen/error_id.hpp"

namespace servodrome::master::plcopen {

class Axis;

// MC_BUFFER_MODE (part 1, clause 2.4.2).
enum class BufferMode : std::uint8_t {
  Aborting,          // starts at once; active and buffered commands are aborted
  Buffered,          // starts when the command before it is done
  BlendingLow,       // blending: the command before passes its target at the lower of both velocities,
  BlendingPrevious,  // ... at its own velocity,
  BlendingNext,      // ... at the velocity of this command,
  BlendingHigh,      // ... at the higher of both
};

// MC_DIRECTION, for MC_MoveVelocity.
enum class Direction : std::uint8_t { Positive, Negative, Current };

// Master value that a slave follows (MC_SOURCE).
enum class Source : std::uint8_t { SetValue, ActualValue };

// A command from a function block to an axis, with its result. In the axis's units and seconds.
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
  double torque_ramp = 0.0;  // 0.1 % of rated torque per second

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

  // ---- Internal to the axis ----
  double target_counts = 0.0;  // target of a position command, once known
  bool is_placed = false;      // target_counts is known

  bool is_over() const { return status == Status::done || status == Status::aborted || status == Status::failed; }
  bool goes_to_a_position() const {
    return kind == CommandKind::MoveAbsolute || kind == CommandKind::MoveRelative || kind == CommandKind::MoveAdditive;
  }
};

// A request of MC_TouchProbe to the axis, with its result.
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

}  // namespace servodrome::master::plcopen
