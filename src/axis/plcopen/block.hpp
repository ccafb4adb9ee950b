#pragma once

#include <memory>

#include "axis/plcopen/axis.hpp"

namespace servodrome::master::plcopen {

// The rules for blocks with Execute (part 1, clause 2.4.1). Inputs are read at its rising edge. At most one of Busy,
// the goal (Done, InVelocity, ...), CommandAborted and Error is TRUE; only a goal that lasts (such as InVelocity) may
// be TRUE together with Busy. Goal, CommandAborted and Error are TRUE for at least one call, and until a call with
// Execute FALSE.
//
// Members have the standard's names. A block is called once in each cycle, with its axis.
class ExecuteBlock {
 public:
  bool Execute = false;

  bool Busy = false;
  bool CommandAborted = false;
  bool Error = false;
  ErrorId ErrorID = ErrorId::none;

 protected:
  // True at a rising edge of Execute.
  bool rises() {
    const bool rising = Execute && !before_;
    before_ = Execute;
    return rising;
  }
  // Called while a result is shown: true if this call must clear it.
  bool is_to_be_cleared() {
    if (!Execute && shown_) return true;
    shown_ = true;
    return false;
  }
  void begin() { shown_ = false; }
  void set(bool busy, bool aborted, ErrorId error) {
    Busy = busy;
    CommandAborted = aborted;
    Error = error != ErrorId::none;
    ErrorID = error;
  }

 private:
  bool before_ = false;
  bool shown_ = false;
};

// A block that commands a motion.
class MotionBlock : public ExecuteBlock {
 public:
  bool Active = false;

 protected:
  // At a rising edge, `make` fills in a command, which goes to the axis. Returns the goal output.
  template <typename Make>
  bool run(Axis& axis, Make make) {
    if (rises()) {
      command_ = std::make_shared<Command>();
      make(*command_);
      axis.give(command_);
      begin();
    }
    return follow();
  }
  Command* command() { return command_.get(); }

 private:
  bool follow();

  std::shared_ptr<Command> command_;
};

// A block that completes within the call: Done or Error in the same cycle.
class InstantBlock : public ExecuteBlock {
 public:
  bool Done = false;

 protected:
  template <typename Act>
  void run(Act act) {
    if (rises()) {
      result_ = act();
      has_result_ = true;
      begin();
    }
    if (has_result_ && is_to_be_cleared()) has_result_ = false;
    Done = has_result_ && result_ == ErrorId::none;
    set(false, false, has_result_ ? result_ : ErrorId::none);
  }

 private:
  ErrorId result_ = ErrorId::none;
  bool has_result_ = false;
};

// The rules for blocks with Enable: while it is TRUE, either Valid with outputs, or Error.
class EnableBlock {
 public:
  bool Enable = false;

  bool Valid = false;
  bool Busy = false;
  bool Error = false;
  ErrorId ErrorID = ErrorId::none;

 protected:
  // `read` sets the outputs and returns the error, or ErrorId::none.
  template <typename Read>
  void run(Read read) {
    ErrorID = Enable ? read() : ErrorId::none;
    Error = ErrorID != ErrorId::none;
    Valid = Busy = Enable && !Error;
  }
};

}  // namespace servodrome::master::plcopen
