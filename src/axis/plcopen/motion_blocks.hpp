#pragma once

#include "axis/plcopen/block.hpp"

// The function blocks of part 1 that move an axis. Positions, velocities etc. are in the axis's units and seconds.
// Velocity, Acceleration and Deceleration must be above zero; Jerk 0 means linear ramps.
namespace servodrome::master::plcopen {

// Common part of MC_MoveAbsolute, MC_MoveRelative, MC_MoveAdditive and MC_MoveVelocity.
class MoveBlock : public MotionBlock {
 public:
  double Velocity = 0.0;
  double Acceleration = 0.0;
  double Deceleration = 0.0;
  double Jerk = 0.0;
  BufferMode Mode = BufferMode::Aborting;  // named BufferMode in the standard

 protected:
  bool move(Axis& axis, CommandKind kind, double position, Direction direction = Direction::Positive) {
    return run(axis, [&](Command& command) {
      command.kind = kind;
      command.buffer_mode = Mode;
      command.position = position;
      command.velocity = Velocity;
      command.acceleration = Acceleration;
      command.deceleration = Deceleration;
      command.jerk = Jerk;
      command.direction = direction;
    });
  }
};

class MC_MoveAbsolute : public MoveBlock {
 public:
  double Position = 0.0;
  bool Done = false;
  void operator()(Axis& axis) { Done = move(axis, CommandKind::MoveAbsolute, Position); }
};

// The distance counts from the set-point at which the motion becomes active.
class MC_MoveRelative : public MoveBlock {
 public:
  double Distance = 0.0;
  bool Done = false;
  void operator()(Axis& axis) { Done = move(axis, CommandKind::MoveRelative, Distance); }
};

// The distance counts from the last target, even if that was not reached.
class MC_MoveAdditive : public MoveBlock {
 public:
  double Distance = 0.0;
  bool Done = false;
  void operator()(Axis& axis) { Done = move(axis, CommandKind::MoveAdditive, Distance); }
};

class MC_MoveVelocity : public MoveBlock {
 public:
  plcopen::Direction Direction = plcopen::Direction::Positive;
  bool InVelocity = false;
  void operator()(Axis& axis) { InVelocity = move(axis, CommandKind::MoveVelocity, 0.0, Direction); }
};

// Stops the axis and blocks all other motions until Execute is FALSE.
class MC_Stop : public MotionBlock {
 public:
  double Deceleration = 0.0;
  double Jerk = 0.0;
  bool Done = false;
  void operator()(Axis& axis) {
    Command* const before = command();
    if (before != nullptr && !Execute) axis.release_stop(*before);
    Done = run(axis, [&](Command& command) {
      command.kind = CommandKind::Stop;
      command.deceleration = Deceleration;
      command.jerk = Jerk;
    });
  }
};

// Stops the axis; another motion may replace it meanwhile.
class MC_Halt : public MotionBlock {
 public:
  double Deceleration = 0.0;
  double Jerk = 0.0;
  BufferMode Mode = BufferMode::Aborting;
  bool Done = false;
  void operator()(Axis& axis) {
    Done = run(axis, [&](Command& command) {
      command.kind = CommandKind::Halt;
      command.buffer_mode = Mode;
      command.deceleration = Deceleration;
      command.jerk = Jerk;
    });
  }
};

// The drive's homing with the method set in its objects (6098h); afterwards the axis is at Position.
class MC_Home : public MotionBlock {
 public:
  double Position = 0.0;
  bool Done = false;
  void operator()(Axis& axis) {
    Done = run(axis, [&](Command& command) {
      command.kind = CommandKind::Home;
      command.position = Position;
    });
  }
};

// Torque in 0.1 % of the rated torque. Velocity: speed limit; the torque is reduced to 0 as the axis approaches it (0:
// no limit).
class MC_TorqueControl : public MotionBlock {
 public:
  double Torque = 0.0;
  double TorqueRamp = 0.0;  // 0.1 % of the rated torque per second
  double Velocity = 0.0;
  BufferMode Mode = BufferMode::Aborting;
  bool InTorque = false;
  void operator()(Axis& axis) {
    InTorque = run(axis, [&](Command& command) {
      command.kind = CommandKind::TorqueControl;
      command.buffer_mode = Mode;
      command.torque = Torque;
      command.torque_ramp = TorqueRamp;
      command.velocity = Velocity;
    });
  }
};

// ---- Multi-axis blocks: part 2 of version 1, part 1 of version 2 ----

// The slave's velocity is the master's times the ratio; from InGear on the positions are coupled as well.
class MC_GearIn : public MotionBlock {
 public:
  double RatioNumerator = 1.0;
  double RatioDenominator = 1.0;
  Source MasterValueSource = Source::SetValue;
  double Acceleration = 0.0;
  double Deceleration = 0.0;
  BufferMode Mode = BufferMode::Aborting;
  bool InGear = false;
  void operator()(Axis& master, Axis& slave) {
    InGear = run(slave, [&](Command& command) {
      command.kind = CommandKind::GearIn;
      command.buffer_mode = Mode;
      command.master = &master;
      command.source = MasterValueSource;
      command.ratio = RatioNumerator / RatioDenominator;
      command.acceleration = Acceleration;
      command.deceleration = Deceleration;
    });
  }
};

// The slave follows the cam. With SlaveAbsolute it must already be at the cam's position when it starts.
class MC_CamIn : public MotionBlock {
 public:
  std::shared_ptr<const CamTable> CamTableID{};
  bool MasterAbsolute = true;
  bool SlaveAbsolute = true;
  double MasterOffset = 0.0;  // in the cam's units, added after scaling
  double SlaveOffset = 0.0;
  double MasterScaling = 1.0;
  double SlaveScaling = 1.0;
  Source MasterValueSource = Source::SetValue;
  bool InSync = false;
  bool EndOfProfile = false;
  void operator()(Axis& master, Axis& slave) {
    InSync = run(slave, [&](Command& command) {
      command.kind = CommandKind::CamIn;
      command.master = &master;
      command.source = MasterValueSource;
      command.cam = CamTableID;
      command.master_is_absolute = MasterAbsolute;
      command.slave_is_absolute = SlaveAbsolute;
      command.master_offset = MasterOffset;
      command.slave_offset = SlaveOffset;
      command.master_scaling = MasterScaling;
      command.slave_scaling = SlaveScaling;
    });
    EndOfProfile = InSync && command()->end_of_profile;
  }
};

// Uncouples the slave from its master; it continues at its velocity, in ContinuousMotion.
class MC_GearOut : public InstantBlock {
 public:
  void operator()(Axis& slave) {
    run([&] { return slave.leave_master(CommandKind::GearIn); });
  }
};
class MC_CamOut : public InstantBlock {
 public:
  void operator()(Axis& slave) {
    run([&] { return slave.leave_master(CommandKind::CamIn); });
  }
};

}  // namespace servodrome::master::plcopen
