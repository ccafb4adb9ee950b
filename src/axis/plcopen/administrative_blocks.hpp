#pragma once

#include "axis/plcopen/block.hpp"

// The function blocks of part 1 that do not move an axis.
namespace servodrome::master::plcopen {

// Parameter numbers (part 1, table of MC_ReadParameter and MC_WriteParameter).
enum class Parameter : std::uint16_t {
  CommandedPosition = 1,
  SWLimitPos = 2,
  SWLimitNeg = 3,
  EnableLimitPos = 4,
  EnableLimitNeg = 5,
  EnablePosLagMonitoring = 6,
  MaxPositionLag = 7,
  MaxVelocitySystem = 8,
  MaxVelocityAppl = 9,
  ActualVelocity = 10,
  CommandedVelocity = 11,
  MaxAccelerationSystem = 12,
  MaxAccelerationAppl = 13,
  MaxDecelerationSystem = 14,
  MaxDecelerationAppl = 15,
  MaxJerkSystem = 16,
  MaxJerkAppl = 17,
};

ErrorId read_parameter(Axis& axis, Parameter number, double& value);
ErrorId read_parameter(Axis& axis, Parameter number, bool& value);
ErrorId write_parameter(Axis& axis, Parameter number, double value);
ErrorId write_parameter(Axis& axis, Parameter number, bool value);

// Switches the drive on while Enable is TRUE. Enable FALSE switches it off at any speed, so stop the axis first. Does
// not reset a fault.
class MC_Power {
 public:
  bool Enable = false;

  bool Status = false;
  bool Valid = false;
  bool Error = false;
  ErrorId ErrorID = ErrorId::none;
  void operator()(Axis& axis) {
    axis.power(Enable);
    Status = axis.is_powered();
    ErrorID = Enable ? axis.error() : ErrorId::none;
    Error = ErrorID != ErrorId::none;
    Valid = Enable && !Error;
  }
};

// Leaves ErrorStop and resets the drive's fault.
class MC_Reset : public ExecuteBlock {
 public:
  bool Done = false;
  void operator()(Axis& axis);

 private:
  static constexpr double patience_s = 2.0;
  bool runs_ = false;
  bool has_result_ = false;
  ErrorId result_ = ErrorId::none;
  double waited_s_ = 0.0;
};

// Shifts the origin so that the axis is at Position, or, with Relative, Position further than before. Nothing moves.
class MC_SetPosition : public InstantBlock {
 public:
  double Position = 0.0;
  bool Relative = false;
  void operator()(Axis& axis) {
    run([&] { return axis.set_position(Position, Relative); });
  }
};

class MC_ReadStatus : public EnableBlock {
 public:
  bool ErrorStop = false, Disabled = false, Stopping = false, Homing = false, Standstill = false,
       DiscreteMotion = false, ContinuousMotion = false, SynchronizedMotion = false;
  void operator()(Axis& axis);
};

class MC_ReadAxisError : public EnableBlock {
 public:
  ErrorId AxisErrorID = ErrorId::none;
  std::uint16_t DriveErrorCode = 0;  // 603Fh at the time of the error; an extension of the standard
  void operator()(Axis& axis) {
    run([&] {
      AxisErrorID = axis.error();
      DriveErrorCode = axis.drive_error_code();
      return ErrorId::none;
    });
  }
};

class MC_ReadParameter : public EnableBlock {
 public:
  Parameter ParameterNumber = Parameter::CommandedPosition;
  double Value = 0.0;
  void operator()(Axis& axis) {
    run([&] { return read_parameter(axis, ParameterNumber, Value); });
  }
};
class MC_ReadBoolParameter : public EnableBlock {
 public:
  Parameter ParameterNumber = Parameter::EnableLimitPos;
  bool Value = false;
  void operator()(Axis& axis) {
    run([&] { return read_parameter(axis, ParameterNumber, Value); });
  }
};
class MC_WriteParameter : public InstantBlock {
 public:
  Parameter ParameterNumber = Parameter::SWLimitPos;
  double Value = 0.0;
  void operator()(Axis& axis) {
    run([&] { return write_parameter(axis, ParameterNumber, Value); });
  }
};
class MC_WriteBoolParameter : public InstantBlock {
 public:
  Parameter ParameterNumber = Parameter::EnableLimitPos;
  bool Value = false;
  void operator()(Axis& axis) {
    run([&] { return write_parameter(axis, ParameterNumber, Value); });
  }
};

class MC_ReadActualPosition : public EnableBlock {
 public:
  double Position = 0.0;
  void operator()(Axis& axis) {
    run([&] { return Position = axis.actual_position(), ErrorId::none; });
  }
};
class MC_ReadActualVelocity : public EnableBlock {
 public:
  double Velocity = 0.0;
  void operator()(Axis& axis) {
    run([&] { return Velocity = axis.actual_velocity(), ErrorId::none; });
  }
};
class MC_ReadActualTorque : public EnableBlock {
 public:
  double Torque = 0.0;  // 0.1 % of rated torque
  void operator()(Axis& axis) {
    run([&] { return Torque = axis.actual_torque(), ErrorId::none; });
  }
};

// TRIGGER_REF: a touch probe input of the drive and the edge.
struct TriggerRef {
  unsigned probe = 1;
  bool rising = true;
};

// Returns the position that the drive latches at an edge. With WindowOnly, edges outside FirstPosition .. LastPosition
// are ignored.
class MC_TouchProbe : public ExecuteBlock {
 public:
  TriggerRef TriggerInput{};
  bool WindowOnly = false;
  double FirstPosition = 0.0;
  double LastPosition = 0.0;
  bool Done = false;
  double RecordedPosition = 0.0;
  void operator()(Axis& axis);

 private:
  std::shared_ptr<ProbeRequest> request_;
  ErrorId error_ = ErrorId::none;
};

// Aborts the MC_TouchProbe that waits at this input.
class MC_AbortTrigger : public InstantBlock {
 public:
  TriggerRef TriggerInput{};
  void operator()(Axis& axis) {
    run([&] {
      axis.disarm(TriggerInput.probe);
      return ErrorId::none;
    });
  }
};

}  // namespace servodrome::master::plcopen
