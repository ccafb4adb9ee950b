#pragma once

#include <cstdint>
#include <span>

#include "drive/homing/methods.hpp"
#include "drive/io/signals.hpp"
#include "drive/units.hpp"

// The executor of homing methods. It decides where to go and when home is found; the motion itself is the caller's:
// ramps with the homing acceleration, and a profiled move for `position`.
//
// Positions, speeds and the two limit signals are those of the encoder: the negative limit switch is the one at the end
// of small counts. An edge carries the first count, in the direction of motion, at which the new level holds. Home is
// the boundary itself: the first count on its positive side, so that the same edge of a switch is the same home
// whichever way it is crossed. For the index it is the boundary on its negative side, in both directions (methods 33
// and 34 agree).
namespace servodrome::drive {

enum class HomingError : std::uint8_t {
  none,
  unsupported_method,
  wrong_limit,     // a limit switch ahead that the method does not turn round at
  home_not_found,  // the other limit switch, after the method had turned round at the first
  timed_out,
  internal,  // the method is not well formed
};

// Where the axis ends after the latch.
enum class HomingEnd : std::uint8_t {
  as_method,  // back at home if the method says so, else where the ramp to rest ends
  home,       // back at home, where it was latched
  offset,     // at HomingConfig::end_offset from home
};

struct HomingConfig {
  double fast = 0.0;                 // counts/s, > 0 (6099h sub 1)
  double slow = 0.0;                 // counts/s, > 0 (6099h sub 2)
  double acceleration = 0.0;         // counts/s^2, > 0 (609Ah): for the caller's ramps, not used here
  float stall_torque = 1.0F;         // fraction of rated torque, in the direction of travel, that is a hard stop ...
  std::uint32_t stall_cycles = 1;    // ... when it lasts so many cycles
  Counts retraction = 0;             // >= 0, distance from a hard stop to home
  std::uint32_t timeout_cycles = 0;  // until the latch; 0: none
  HomingEnd end = HomingEnd::as_method;
  Counts end_offset = 0;
  Counts blind_window = 0;  // an index so close behind the edge of a switch is passed by
  Counts index_width = 1;   // from the rising to the falling edge of the index in positive direction
  bool reversed = false;    // 607Eh bit 7: a method's positive direction is that of falling counts
};

struct HomingInputs {
  std::uint32_t signals = 0;            // levels, bit(Signal)
  std::span<const SignalEdge> edges{};  // since the last cycle, in the order they happened
  bool standing = true;                 // the demand is at rest; false as soon as a command moves it
  float torque = 0.0F;                  // fraction of rated torque, positive towards larger counts
  Counts position = 0;                  // actual position
  bool moves = false;                   // the shaft does
};

struct HomingCommand {
  enum class Kind : std::uint8_t {
    keep,      // nothing new
    velocity,  // ramp to `velocity` and stay there
    position,  // profiled move to `position` at the speed |velocity|, ending at rest
    stop,      // ramp to zero
    hold,      // `position` is the demand from now on, at zero speed, without a ramp
  };
  Kind kind = Kind::keep;
  double velocity = 0.0;  // counts/s, signed
  Counts position = 0;
};

class Homing {
 public:
  // Begins, unless the method is idle; the first command comes from the next step. What ran before is forgotten.
  void start(const Method& method, const HomingConfig& config, const HomingInputs& inputs);

  // The same by number; error() is unsupported_method if the table has none.
  void start(std::span<const Method> methods, std::int8_t number, const HomingConfig& config,
             const HomingInputs& inputs);

  // Once per position-loop cycle, but not while the axis is halted (605Dh): standstill is taken for the end of a ramp.
  // Answers `keep` while not active.
  HomingCommand step(const HomingInputs& inputs);
  // In place of it, while the axis is halted: what it meets on the way to rest counts, and the command is for the end
  // of the halt.
  HomingCommand step_halted(HomingInputs inputs);

  // Forgets everything; stopping the axis is the caller's.
  void abort() { *this = Homing{}; }

  bool active() const { return phase_ != Phase::idle; }  // from start until finished or failed
  bool latched() const { return latched_; }              // home is known (statusword bit 12); the axis may still move
  Counts latch() const { return latch_; }                // where home is, if latched()
  bool finished() const { return finished_; }            // latched and at rest (bit 10)
  // From the edge of the switch to the index that was latched, >= 0; -1: the method has no switch before its index.
  Counts index_distance() const { return index_distance_; }
  HomingError error() const { return error_; }  // after `stop` was commanded
  Signal limit_ahead() const;                   // that of the present leg, or of the one that failed

  // The present leg looks for a hard stop: the following error is no fault, and the caller limits the torque.
  bool pressing() const;

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
  bool stops_first_ = false;  // what moved before homing began comes to rest
  bool limit_seen_ = false;
  bool latched_ = false;
  bool finished_ = false;
  std::uint32_t cycles_ = 0;
  std::uint32_t stall_count_ = 0;
  Counts leg_start_ = 0;
  Counts latch_ = 0;
  Counts end_ = 0;  // of the way after it
  Counts switch_edge_ = 0;
  bool switch_seen_ = false;
  Counts index_distance_ = -1;
};

}  // namespace servodrome::drive
