#include "axis/plcopen/block.hpp"

namespace servodrome::master::plcopen {

bool MotionBlock::follow() {
  set(false, false, ErrorId::none);
  Active = false;
  if (!command_) return false;
  const bool goal = command_->status == Command::Status::done || command_->in_goal;
  if ((goal || command_->is_over()) && is_to_be_cleared()) {
    // A motion that has not ended continues without this block.
    command_.reset();
    return false;
  }
  switch (command_->status) {
    case Command::Status::buffered: Busy = true; break;
    case Command::Status::active: Busy = Active = true; break;
    case Command::Status::done: break;
    case Command::Status::aborted: set(false, true, ErrorId::none); return false;
    case Command::Status::failed: set(false, false, command_->error); return false;
  }
  return goal;
}

}  // namespace servodrome::master::plcopen
