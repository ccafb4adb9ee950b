// State diagram, commands, power, homing. Targets and blending: axis_blending.cpp. Cycle of a synchronised motion:
// axis_synchronized.cpp.
#include "axis/plcopen/axis.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace servodrome::master::plcopen {

namespace {

bool is_positive(double value) { return std::isfinite(value) && value > 0.0; }

// Returns the position in counts at which the axis comes to rest if it brakes from `state` within `limits`.
double place_of_rest(const MotionState& state, const MotionLimits& limits) {
  trajectory::Trajectory brake;
  const auto shape = limits.jerk > 0.0 ? trajectory::RampShape::jerk_limited : trajectory::RampShape::linear;
  if (brake.plan_velocity(state, 0.0, limits, shape) != trajectory::Trajectory::Result::ok) return state.position;
  return brake.at(brake.duration_s()).position;
}

}  // namespace

Axis::Axis(MotionAxis& motion, const AxisConfiguration& configuration)
    : motion_(motion), configuration_(configuration), scale_(configuration.counts_per_unit) {
  if (!std::isfinite(scale_) || scale_ == 0.0) {
    throw MasterError("counts_per_unit is 0 or no number", motion.axis().where(),
                      "give the counts per unit of position");
  }
  for (const double greatest : {configuration.max_velocity, configuration.max_acceleration,
                                configuration.max_deceleration, configuration.max_jerk}) {
    if (is_positive(greatest)) continue;
    throw MasterError("a greatest velocity, acceleration, deceleration or jerk is not finite and above 0",
                      motion.axis().where(), "stops use the greatest deceleration: give a number");
  }
}

// ---- Commands ----

MotionLimits Axis::limits_of(const Command& command) const {
  const double scale = std::abs(scale_);
  const auto or_greatest = [](double value, double greatest) { return value > 0.0 ? value : greatest; };
  return {or_greatest(command.velocity, configuration_.max_velocity) * scale,
          or_greatest(command.acceleration, configuration_.max_acceleration) * scale,
          or_greatest(command.deceleration, configuration_.max_deceleration) * scale, command.jerk * scale};
}

ErrorId Axis::check_dynamics(const Command& command) const {
  const bool stops = command.kind == CommandKind::Stop || command.kind == CommandKind::Halt;
  const bool needs_velocity = command.goes_to_a_position() || command.kind == CommandKind::MoveVelocity;
  if (needs_velocity && !is_positive(command.velocity)) return ErrorId::parameter_invalid;
  if (!stops && !is_positive(command.acceleration)) return ErrorId::parameter_invalid;
  if (!is_positive(command.deceleration)) return ErrorId::parameter_invalid;
  if (!std::isfinite(command.jerk) || command.jerk < 0.0 || !std::isfinite(command.position)) {
    return ErrorId::parameter_invalid;
  }
  const bool above = command.velocity > configuration_.max_velocity ||
                     command.acceleration > configuration_.max_acceleration ||
                     command.deceleration > configuration_.max_deceleration || command.jerk > configuration_.max_jerk;
  return above ? ErrorId::above_limit : ErrorId::none;
}

bool Axis::follows(const Axis& other) const {
  const Axis* at = this;
  while (at->active_ && at->active_->master != nullptr) {
    at = at->active_->master;
    if (at == &other) return true;
  }
  return false;
}

ErrorId Axis::check_master(const Command& command) const {
  if (command.master == nullptr || command.master == this || command.master->follows(*this)) {
    return ErrorId::master_invalid;
  }
  if (command.kind == CommandKind::GearIn) {
    if (!std::isfinite(command.ratio)) return ErrorId::master_invalid;
    return check_dynamics(command);
  }
  if (command.cam == nullptr || !command.cam->valid()) return ErrorId::parameter_invalid;
  for (const double number :
       {command.master_offset, command.slave_offset, command.master_scaling, command.slave_scaling}) {
    if (!std::isfinite(number)) return ErrorId::parameter_invalid;
  }
  if (!command.slave_is_absolute) return ErrorId::none;
  // The slave must be on the cam already, because coupling must not make it jump.
  const double begin = counts_of(cam_value(command, cam_origin(command)).slave);
  return std::abs(begin - motion_.set_point().position) <= 1.0 ? ErrorId::none : ErrorId::not_on_the_cam;
}

ErrorId Axis::check_torque(const Command& command) const {
  constexpr double greatest = std::numeric_limits<std::int16_t>::max();  // of 6071h
  const bool is_valid = std::abs(command.torque) <= greatest && is_positive(command.torque_ramp) &&
                        std::isfinite(command.velocity) && command.velocity >= 0.0;
  if (!is_valid) return ErrorId::parameter_invalid;
  return command.velocity > configuration_.max_velocity ? ErrorId::above_limit : ErrorId::none;
}

ErrorId Axis::check(const Command& command) const {
  if (!permitted(command.kind, state_)) return ErrorId::state_does_not_permit;
  if (command.buffer_mode != BufferMode::Aborting && queue_.size() >= most_buffered) return ErrorId::queue_full;
  switch (command.kind) {
    case CommandKind::Home:
      return motion_.axis().can_command(OperationMode::homing) ? ErrorId::none : ErrorId::not_mapped;
    case CommandKind::TorqueControl:
      if (!motion_.axis().can_command(OperationMode::cyclic_synchronous_torque)) return ErrorId::not_mapped;
      return check_torque(command);
    case CommandKind::GearIn:
    case CommandKind::CamIn: return check_master(command);
    default: break;
  }
  const ErrorId error = check_dynamics(command);
  if (error != ErrorId::none || !command.goes_to_a_position()) return error;
  Command placed = command;
  const bool at_once = command.buffer_mode == BufferMode::Aborting || !active_;
  const bool behind_a_target = !at_once && (queue_.empty() ? active_ : queue_.back())->is_placed;
  place(placed,
        behind_a_target ? (queue_.empty() ? active_ : queue_.back())->target_counts : motion_.set_point().position);
  const double target = units_of(placed.target_counts);
  const bool beyond = (configuration_.enable_positive_limit && target > configuration_.positive_limit) ||
                      (configuration_.enable_negative_limit && target < configuration_.negative_limit);
  return beyond ? ErrorId::beyond_software_limit : ErrorId::none;
}

void Axis::give(const CommandPointer& command) {
  command->error = check(*command);
  if (command->error != ErrorId::none) {
    command->status = Command::Status::failed;
    return;
  }
  if (command->buffer_mode == BufferMode::Aborting || !active_) {
    abort_all();
    start(command, From::present);
    return;
  }
  queue_.push_back(command);
  place_queue();
  // The active command may now pass its target instead of stopping there.
  if (active_->goes_to_a_position()) {
    motion_.move_to(active_->target_counts, end_velocity_of_active(motion_.set_point().position), limits_of(*active_));
  }
}

void Axis::start(const CommandPointer& command, From from) {
  active_ = command;
  command->status = Command::Status::active;
  state_ = state_of(command->kind);
  const MotionLimits limits = limits_of(*command);
  const double here = from == From::end ? last_target_ : motion_.set_point().position;
  switch (command->kind) {
    case CommandKind::Home:
      is_homed_ = false;
      motion_.home();
      break;
    case CommandKind::Stop:
    case CommandKind::Halt:
      motion_.abort_homing();
      motion_.run_at(0.0, limits, from);
      break;
    case CommandKind::MoveAbsolute:
    case CommandKind::MoveRelative:
    case CommandKind::MoveAdditive:
      if (!command->is_placed) place(*command, here);
      place_queue();
      motion_.move_to(command->target_counts, end_velocity_of_active(here), limits, from);
      last_target_ = command->target_counts;
      break;
    case CommandKind::MoveVelocity: {
      const double present = motion_.set_point().velocity;
      double sign = scale_ < 0.0 ? -1.0 : 1.0;
      if (command->direction == Direction::Negative) sign = -sign;
      if (command->direction == Direction::Current && present != 0.0) sign = present < 0.0 ? -1.0 : 1.0;
      motion_.run_at(sign * limits.velocity, limits, from);
      break;
    }
    case CommandKind::TorqueControl:
      motion_.apply_torque(torque_of(*command), command->torque_ramp, command->velocity * std::abs(scale_));
      break;
    case CommandKind::GearIn: break;
    case CommandKind::CamIn:
      master_origin_ = cam_origin(*command);
      slave_origin_ = command->slave_is_absolute
                          ? -offset_
                          : motion_.set_point().position / scale_ - cam_value(*command, master_origin_).slave;
      break;
  }
}

void Axis::finish(Command::Status status) {
  // A finished MC_Stop keeps the status done.
  if (active_ && !active_->is_over()) active_->status = status;
  active_.reset();
}

void Axis::abort_all() {
  finish(Command::Status::aborted);
  for (const CommandPointer& command : queue_) command->status = Command::Status::aborted;
  queue_.clear();
}

void Axis::go_on(From from) {
  if (queue_.empty()) {
    state_ = AxisState::Standstill;
    return;
  }
  const CommandPointer next = queue_.front();
  queue_.pop_front();
  start(next, from);
}

void Axis::release_stop(Command& stop) { stop.released = true; }

ErrorId Axis::leave_master(CommandKind kind) {
  if (!active_ || active_->kind != kind) return ErrorId::state_does_not_permit;
  // The axis continues as with MC_MoveVelocity, with the dynamics of the command that it leaves.
  const auto goes_on = std::make_shared<Command>(*active_);
  const double velocity = motion_.set_point().velocity / scale_;
  goes_on->kind = CommandKind::MoveVelocity;
  goes_on->direction = velocity < 0.0 ? Direction::Negative : Direction::Positive;
  goes_on->velocity = std::abs(velocity);
  goes_on->master = nullptr;
  goes_on->cam.reset();
  abort_all();
  active_ = goes_on;
  active_->status = Command::Status::active;
  state_ = AxisState::ContinuousMotion;
  motion_.run_at(motion_.set_point().velocity, limits_of(*goes_on));
  return ErrorId::none;
}

ErrorId Axis::set_position(double position, bool relative) {
  if (!std::isfinite(position)) return ErrorId::parameter_invalid;
  if (state_ == AxisState::Homing) return ErrorId::state_does_not_permit;
  offset_ += relative ? position : position - actual_position();
  return ErrorId::none;
}

// ---- Power and errors ----

void Axis::power(bool on) { motion_.switch_on(on); }

void Axis::enter_error_stop(ErrorId error, std::optional<MotionLimits> brake) {
  if (!brake) brake = limits_of(active_ ? *active_ : Command{});
  if (active_ && !active_->is_over()) active_->error = error;
  finish(Command::Status::failed);
  for (const CommandPointer& command : queue_) {
    command->error = error;
    command->status = Command::Status::failed;
  }
  queue_.clear();
  state_ = AxisState::ErrorStop;
  error_ = error;
  if (motion_.is_enabled()) motion_.run_at(0.0, *brake);
}

ErrorId Axis::reset() {
  if (state_ != AxisState::ErrorStop) return ErrorId::none;
  resetting_ = true;
  if (motion_.fault() != AxisFault::none) motion_.reset_fault();
  return ErrorId::none;
}

void Axis::cancel_reset() {
  resetting_ = false;
  motion_.cancel_reset();
}

void Axis::watch_power() {
  if (motion_.fault() != AxisFault::none) {
    if (state_ != AxisState::ErrorStop) enter_error_stop(error_of(motion_.fault()));
    if (resetting_) error_ = error_of(motion_.fault());
    return;
  }
  if (state_ == AxisState::ErrorStop) {
    if (!resetting_ || (motion_.is_enabled() && !motion_.generator().done())) return;
    resetting_ = false;
    error_ = ErrorId::none;
    state_ = AxisState::Disabled;
  }
  if (!motion_.is_enabled() && state_ != AxisState::Disabled) {
    abort_all();
    state_ = AxisState::Disabled;
  } else if (motion_.is_enabled() && state_ == AxisState::Disabled) {
    last_target_ = motion_.set_point().position;
    state_ = AxisState::Standstill;
  }
}

void Axis::watch_homing() {
  if (!active_ || active_->kind != CommandKind::Home || motion_.is_homing()) return;
  is_homed_ = motion_.is_homed();
  offset_ = active_->position - motion_.set_point().position / scale_;
  last_target_ = motion_.set_point().position;
  finish(Command::Status::done);
  go_on(From::present);
}

// Stops the axis if braking from now on would end beyond a limit. If the deceleration of the command is too low to stop
// before the limit, as with an MC_Halt close to it, the axis brakes with the deceleration that just suffices.
void Axis::watch_software_limits() {
  if (state_ == AxisState::Homing || state_ == AxisState::ErrorStop || state_ == AxisState::Disabled) return;
  const MotionState present = motion_.set_point();
  const double velocity = present.velocity / scale_;
  const bool is_limited = velocity > 0.0 ? configuration_.enable_positive_limit : configuration_.enable_negative_limit;
  if (velocity == 0.0 || !is_limited) return;
  const double limit = counts_of(velocity > 0.0 ? configuration_.positive_limit : configuration_.negative_limit);
  const double direction = present.velocity > 0.0 ? 1.0 : -1.0;
  MotionLimits brake = limits_of(active_ ? *active_ : Command{});
  const double beyond = (place_of_rest(present, brake) - limit) * direction;
  if (beyond <= 1e-6 * (1.0 + std::abs(limit - present.position))) return;
  const double room = (limit - present.position) * direction;
  if (room > 0.0 && beyond > std::abs(present.velocity) * motion_.generator().period_s()) {
    const double needed = present.velocity * present.velocity / (2.0 * room);
    brake.deceleration = std::min(needed, configuration_.max_deceleration * std::abs(scale_));
    brake.jerk = 0.0;
  }
  enter_error_stop(ErrorId::software_limit_reached, brake);
}

// ---- Each cycle ----

void Axis::begin_cycle() {
  // A motion without a target, and standstill: MC_MoveAdditive adds to the present set-point.
  const bool has_target = active_ && active_->goes_to_a_position();
  motion_.set_following_error_limit(
      configuration_.enable_lag_monitoring ? configuration_.max_position_lag * std::abs(scale_) : 0.0);
  watch_power();
  watch_homing();
  if (!has_target) last_target_ = motion_.set_point().position;
  watch_probes();
}

void Axis::update(std::uint64_t cycle) {
  if (updated_in_ == cycle) return;
  updated_in_ = cycle;
  if (active_ && active_->master != nullptr) active_->master->update(cycle);
  update_active();
  watch_software_limits();
}

void Axis::update_active() {
  if (!active_) return;
  const CommandPointer present = active_;
  Command& command = *present;
  const bool done = motion_.is_done();
  switch (command.kind) {
    case CommandKind::Home: break;
    case CommandKind::Stop:
      if (motion_.is_homing() || !done) break;
      last_target_ = motion_.set_point().position;
      command.status = Command::Status::done;
      if (!command.released) break;
      active_.reset();
      state_ = AxisState::Standstill;
      break;
    case CommandKind::Halt:
      if (!done) break;
      last_target_ = motion_.set_point().position;
      finish(Command::Status::done);
      go_on(From::present);
      break;
    case CommandKind::MoveAbsolute:
    case CommandKind::MoveRelative:
    case CommandKind::MoveAdditive:
      if (!done || !motion_.follows_target()) break;
      finish(Command::Status::done);
      go_on(From::end);
      break;
    case CommandKind::MoveVelocity:
      command.in_goal = done;
      end_by_next(command);
      break;
    case CommandKind::TorqueControl:
      command.in_goal = motion_.torque_set_point() == torque_of(command) &&
                        motion_.axis().mode() == static_cast<std::int8_t>(OperationMode::cyclic_synchronous_torque);
      end_by_next(command);
      break;
    case CommandKind::GearIn:
      follow_gear(command);
      end_by_next(command);
      break;
    case CommandKind::CamIn:
      follow_cam(command);
      end_by_next(command);
      break;
  }
}

// A command that does not end by itself (such as MC_MoveVelocity) ends when it has reached its goal and another command
// is buffered behind it.
void Axis::end_by_next(const Command& command) {
  if (&command != active_.get() || !command.in_goal || queue_.empty()) return;
  finish(Command::Status::aborted);
  go_on(From::present);
}

// ---- Touch probes ----

ErrorId Axis::arm(const std::shared_ptr<ProbeRequest>& request) {
  if (!motion_.axis().has_touch_probe(request->probe, request->rising)) return ErrorId::not_mapped;
  Probe& probe = probes_[request->probe - 1];
  if (probe.request) return ErrorId::probe_in_use;
  probe = {.request = request};
  return ErrorId::none;
}

void Axis::disarm(unsigned number) {
  if (number < 1 || number > probes_.size()) return;
  Probe& probe = probes_[number - 1];
  if (probe.request) probe.request->status = ProbeRequest::Status::aborted;
  probe = {};
}

// Bits of 60B8h and 60B9h: probe 1 in bits 0 to 7, probe 2 in bits 8 to 15 (CiA 402-2 clause 12.2).
void Axis::watch_probes() {
  constexpr unsigned enable = 0x01;
  constexpr unsigned rising = 0x10;
  constexpr unsigned falling = 0x20;
  if (!motion_.axis().has_touch_probe(1, true) && !motion_.axis().has_touch_probe(2, true)) return;
  unsigned function = 0;
  for (unsigned number = 1; number <= probes_.size(); ++number) {
    Probe& probe = probes_[number - 1];
    if (!probe.request) continue;
    ProbeRequest& request = *probe.request;
    const unsigned shift = 8 * (number - 1);
    const unsigned status = motion_.axis().touch_probe_status() >> shift & 0xFFU;
    if (request.status == ProbeRequest::Status::clearing && (status & 1) == 0) {
      request.status = ProbeRequest::Status::waiting;
    } else if (request.status == ProbeRequest::Status::waiting && (status & 1) != 0 &&
               (status & (request.rising ? 2U : 4U)) != 0) {
      const auto raw = static_cast<std::uint32_t>(motion_.axis().touch_probe_position(number, request.rising));
      const auto here = static_cast<std::uint32_t>(motion_.position());
      request.recorded_position =
          units_of(static_cast<double>(motion_.position() + static_cast<std::int32_t>(raw - here)));
      const bool inside =
          request.recorded_position >= request.first_position && request.recorded_position <= request.last_position;
      if (request.window_only && !inside) {
        request.status = ProbeRequest::Status::clearing;
      } else {
        request.status = ProbeRequest::Status::done;
        probe = {};
        continue;
      }
    }
    if (request.status == ProbeRequest::Status::waiting) {
      function |= (enable | (request.rising ? rising : falling)) << shift;
    }
  }
  motion_.axis().set_touch_probe_function(static_cast<std::uint16_t>(function));
}

}  // namespace servodrome::master::plcopen
