#pragma once

#include <cstdint>
#include <span>

#include "drive/homing/methods.hpp"
#include "drive/signals.hpp"
#include "drive/units.hpp"

// Executes homing methods. It decides where to move and when home is found. The caller makes the motion: ramps with the
// homing acceleration, and a profiled move for `position`.
//
// Positions, speeds and limit signals are in encoder direction: the negative limit switch is at the end of small
// counts. An edge carries the first count, in the direction of motion, at which the new level holds. Home is the first
// count on the positive side of the boundary, so that an edge of a switch gives the same home in both directions. For
// the index, home is the boundary on its negative side in both directions (methods 33 and 34 agree).
namespace servodrome::drive {

enum class HomingError : std::uint8_t {
  none,
  unsupported_method,
  wrong_limit,     // a limit switch ahead that the method does not turn round at
  home_not_found,  // the axis met the other limit switch after turning round at the first
  driven_back,     // the load is stronger than the torque that may press against a hard stop
  timed_out,
  internal,  // the method is not well formed
};

// The final position after the latch.
enum class HomingEnd : std::uint8_t {
  as_method,  // back at home if the method says so, else at the end of the ramp to rest
  home,       // back at home, the latched position
  offset,     // at HomingConfig::end_offset from home
};

struct HomingConfig {
  double fast = 0.0;                 // counts/s, > 0 (6099h sub 1)
  double slow = 0.0;                 // counts/s, > 0 (6099h sub 2)
  double acceleration = 0.0;         // counts/s^2, > 0 (609Ah): for the caller's ramps, not used here
  float stall_torque = 1.0F;         // torque in the direction of travel that means a hard stop, fraction of rated ...
  std::uint32_t stall_cycles = 1;    // ... if it lasts for this many cycles
  Counts stall_window = 0;           // ... while the shaft stays within this distance
  Counts retraction = 0;             // >= 0, distance from a hard stop to home
  std::uint32_t timeout_cycles = 0;  // until the latch; 0: none
  HomingEnd end = HomingEnd::as_method;
  Counts end_offset = 0;
  Counts slack = 0;         // a shaft within this distance behind the beginning of a leg may still catch up
  Counts blind_window = 0;  // an index within this distance behind the edge of a switch is ignored
  Counts index_width = 1;   // from the rising to the falling edge of the index in positive direction
  bool reversed = false;    // 607Eh bit 7: the positive direction of a method is towards smaller counts
};

struct HomingInputs {
  std::uint32_t signals = 0;            // levels, bit(Signal)
  std::span<const SignalEdge> edges{};  // since the last cycle, in order of time
  bool standing = true;                 // the demand is at rest; false as soon as a command moves it
  float torque = 0.0F;                  // fraction of rated torque, positive towards larger counts
  Counts position = 0;                  // actual position
  double velocity = 0.0;                // of the shaft, counts/s
  bool moves = false;                   // the shaft moves
  int ahead = 0;  // the direction (-1, +1) in which the demand is farther ahead of the shaft than the loops' normal lag
};

struct HomingCommand {
  enum class Kind : std::uint8_t {
    keep,      // no change
    velocity,  // ramp to `velocity` and keep it
    position,  // profiled move to `position` at the speed |velocity|, ending at rest
    stop,      // ramp to zero
    hold,      // the demand is `position` from now on, at zero speed, without a ramp
  };
  Kind kind = Kind::keep;
  double velocity = 0.0;  // counts/s, signed
  Counts position = 0;
};

class Homing {
 public:
  // Begins, unless the method is idle; the next step returns the first command. A homing before is discarded.
  void start(const Method& method, const HomingConfig& config, const HomingInputs& inputs);

  // The same by number; error() is unsupported_method if the table has none.
  void start(std::span<const Method> methods, std::int8_t number, const HomingConfig& config,
             const HomingInputs& inputs);

  // Once per position-loop cycle, but not while the axis is halted (605Dh), because standstill means the end of a ramp
  // here. Returns `keep` while not active.
  HomingCommand step(const HomingInputs& inputs);
  // Call this instead of step() while the axis is halted. Edges on the ramp to rest count; the returned command is for
  // the end of the halt.
  HomingCommand step_halted(HomingInputs inputs);

  // Discards the homing; the caller must stop the axis.
  void abort() { *this = Homing{}; }

  std::uint8_t present_leg() const { return leg_; }            // while active, from 0
  bool active() const { return phase_ != Phase::idle; }        // from start until finished or failed
  bool awaits_rest() const { return phase_ == Phase::begin; }  // the axis moved at the start
  bool latched() const { return latched_; }    // home is known (statusword bit 12); the axis may still move
  Counts latch() const { return latch_; }      // position of home, if latched()
  bool finished() const { return finished_; }  // latched and at rest (bit 10)
  // Distance from the edge of the switch to the latched index, >= 0; -1: the method has no switch before its index.
  Counts index_distance() const { return index_distance_; }
  HomingError error() const { return error_; }  // after `stop` was commanded
  Signal limit_ahead() const;                   // for the present leg, or the leg that failed

  // The direction in which the present leg searches for a hard stop, -1 or +1: in this direction the caller must limit
  // the torque and ignore the following error. 0: no such leg.
  int pressing() const;

 private:
  enum class Phase : std::uint8_t {
    idle,
    begin,      // homing has been started
    wait,       // ramp to zero before the leg
    run,        // the leg runs
    settle,     // latched, ramp to zero
    return_to,  // latched, on the way back to the latch or on to the offset
  };

  const Leg& leg() const { return method_.legs[leg_]; }
  Direction travel() const;
  bool is_active(Signal signal, const HomingInputs& inputs) const { return (inputs.signals & bit(signal)) != 0; }
  bool meets(const SignalEdge& edge) const;
  bool lies_ahead(Counts position) const;
  Counts boundary(const SignalEdge& edge) const;
  Counts distance_from_switch(const SignalEdge& edge) const;
  bool is_blind_to(const SignalEdge& edge) const;
  bool stalls(const HomingInputs& inputs);
  bool is_driven_back(const HomingInputs& inputs) const;
  std::uint8_t first_leg(const HomingInputs& inputs) const;
  HomingCommand begin_leg(const HomingInputs& inputs);
  HomingCommand run_leg(const HomingInputs& inputs);
  bool offset_leads_into_limit(const HomingInputs& inputs) const;
  HomingCommand meet_limit();
  HomingCommand stop_before(std::uint8_t leg);
  HomingCommand take_latch(Counts position);
  HomingCommand fail(HomingError error);

  Method method_{};
  HomingConfig config_{};
  Phase phase_ = Phase::idle;
  HomingError error_ = HomingError::none;
  std::uint8_t leg_ = 0;
  bool stops_first_ = false;  // the axis moved when homing began, and comes to rest first
  bool limit_seen_ = false;
  bool latched_ = false;
  bool finished_ = false;
  std::uint32_t cycles_ = 0;
  std::uint32_t stall_count_ = 0;
  Counts stall_position_ = 0;
  Counts leg_start_ = 0;
  Counts latch_ = 0;
  Counts end_ = 0;  // target of the way after the latch
  Counts switch_edge_ = 0;
  bool switch_seen_ = false;
  Counts index_distance_ = -1;
};

}  // namespace servodrome::drive
