// Targets of buffered commands, and the velocity at which each passes its target.
#include <algorithm>
#include <cmath>

#include "axis/plcopen/axis.hpp"

namespace servodrome::master::plcopen {

namespace {

double sign_of(double value) { return value < 0.0 ? -1.0 : 1.0; }

}  // namespace

// Computes the target of a position command. `previous_target`: target of the command before it, in counts.
void Axis::place(Command& command, double previous_target) const {
  switch (command.kind) {
    case CommandKind::MoveAbsolute: command.target_counts = counts_of(command.position); break;
    case CommandKind::MoveRelative: command.target_counts = previous_target + command.position * scale_; break;
    case CommandKind::MoveAdditive: {
      // Adds to the last target, even if that was not reached. In ContinuousMotion there is no target, so it adds to
      // the present set-point.
      const bool at_once = command.buffer_mode == BufferMode::Aborting && state_ == AxisState::DiscreteMotion;
      command.target_counts = (at_once ? last_target_ : previous_target) + command.position * scale_;
      break;
    }
    default: return;
  }
  command.is_placed = true;
}

void Axis::place_queue() {
  const Command* before = active_.get();
  for (const CommandPointer& command : queue_) {
    if (!command->is_placed && before != nullptr && before->is_placed) place(*command, before->target_counts);
    before = command.get();
  }
}

// Velocity at which `before` passes its target. `direction`: of `before`; `end_of_next`: velocity at which `next`
// passes its own target.
double Axis::blending_velocity(const Command& before, double direction, const Command& next, double end_of_next) const {
  const double first = limits_of(before).velocity;
  const double second = limits_of(next).velocity;
  double velocity = 0.0;
  switch (next.buffer_mode) {
    case BufferMode::Aborting:
    case BufferMode::Buffered: return 0.0;
    case BufferMode::BlendingLow: velocity = std::min(first, second); break;
    case BufferMode::BlendingPrevious: velocity = first; break;
    case BufferMode::BlendingNext: velocity = second; break;
    case BufferMode::BlendingHigh: velocity = std::max(first, second); break;
  }
  if (next.kind == CommandKind::MoveVelocity) {
    const double to = (next.direction == Direction::Negative ? -1.0 : 1.0) * sign_of(scale_);
    return next.direction == Direction::Current || to == direction ? velocity : 0.0;
  }
  if (!next.is_placed) return 0.0;
  const double way = next.target_counts - before.target_counts;
  if (way == 0.0 || sign_of(way) != direction) return 0.0;
  return std::min(velocity, velocity_to_slow_within(std::abs(way), end_of_next, limits_of(next)));
}

// Calculates backwards from the last command to the active one, so that no command passes its target faster than the
// commands after it can brake.
double Axis::end_velocity_of_active(double from) {
  double end = 0.0;
  for (std::size_t i = queue_.size(); i-- > 0;) {
    const Command& before = i == 0 ? *active_ : *queue_[i - 1];
    if (!before.is_placed) {
      end = 0.0;
      continue;
    }
    const double start = i == 0                               ? from
                         : i == 1 && active_->is_placed       ? active_->target_counts
                         : i >= 2 && queue_[i - 2]->is_placed ? queue_[i - 2]->target_counts
                                                              : before.target_counts;
    end = blending_velocity(before, sign_of(before.target_counts - start), *queue_[i], end);
  }
  return end;
}

}  // namespace servodrome::master::plcopen
