#include "axis/cyclic/motion_axis.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "axis/cia402_words.hpp"

namespace servodrome::master {

namespace {

// Fraction of the velocity limit over which the torque falls linearly to 0.
constexpr double torque_taper = 0.1;

double seconds(Time time) { return std::chrono::duration<double>(time).count(); }

}  // namespace

const char* name(AxisFault fault) {
  switch (fault) {
    case AxisFault::none: return "no fault";
    case AxisFault::drive_fault: return "the drive has a fault";
    case AxisFault::left_operation: return "the drive left operation enabled by itself";
    case AxisFault::communication_lost: return "its process data were not received";
    case AxisFault::following_error: return "the following error is too large";
    case AxisFault::mode_refused: return "the drive does not accept the mode of operation";
    case AxisFault::homing_failed: return "homing failed";
  }
  return "unknown fault";
}

const char* remedy_of(AxisFault fault) {
  switch (fault) {
    case AxisFault::none: return "nothing";
    case AxisFault::drive_fault: return "look at its error code 603Fh, remove the cause and reset the fault";
    case AxisFault::left_operation:
      return "check its supply, enable and safety inputs, and whether another master commands it";
    case AxisFault::communication_lost: return "check cables and power; `servodrome scan` lists the drives";
    case AxisFault::following_error: return "check load, brake and limits, or reduce the dynamics";
    case AxisFault::mode_refused: return "see 6502h for the modes that it has, and that 6060h and 6061h are mapped";
    case AxisFault::homing_failed: return "check switches, method 6098h and speeds 6099h";
  }
  return "";
}

MotionAxis::MotionAxis(const CyclicAxis& axis, Time period, const MotionAxisOptions& options)
    : axis_(axis),
      options_(options),
      generator_(seconds(period)),
      mode_timeout_cycles_(static_cast<std::uint64_t>(std::max<std::int64_t>(options.mode_timeout / period, 1))),
      settling_cycles_(static_cast<std::uint64_t>(std::max<std::int64_t>(settling / period, 4))) {
  if (!axis_.can_command(options.position_mode)) {
    throw MasterError(
        fmt::format("its process data lack target and position for {}", master::name(options.position_mode)),
        axis_.where(), "map 607Ah (or 60C1h sub 1) and 6064h");
  }
  generator_.reset({});
}

OperationMode MotionAxis::mode_of(Task task) const {
  switch (task) {
    case Task::velocity: return OperationMode::cyclic_synchronous_velocity;
    case Task::torque: return OperationMode::cyclic_synchronous_torque;
    case Task::homing: return OperationMode::homing;
    case Task::position: break;
  }
  return options_.position_mode;
}

// If the drive does not map its mode display, it is assumed to be in the mode that was set up.
bool MotionAxis::mode_is(OperationMode mode) const {
  return !axis_.shows_mode() || axis_.mode() == static_cast<std::int8_t>(mode);
}

// ---- Inputs ----

void MotionAxis::take_position() {
  const std::int32_t raw = axis_.position();
  const std::int64_t before = position_;
  if (!has_position_) {
    position_ = raw;
    has_position_ = true;
  } else {
    // The drive's position wraps at 32 bits, so the difference is taken modulo 2^32.
    position_ += static_cast<std::int32_t>(static_cast<std::uint32_t>(raw) - static_cast<std::uint32_t>(position_));
  }
  velocity_ = axis_.shows_velocity() ? axis_.velocity() / options_.velocity_scale
                                     : static_cast<double>(position_ - before) / generator_.period_s();
}

void MotionAxis::fail(AxisFault fault) {
  if (fault_ != AxisFault::none) return;
  fault_ = fault;
  error_code_ = axis_.error_code();
  enabled_ = false;
  task_ = Task::position;
}

// Returns true while the drive is in another mode. The drive must not be enabled in that mode, because it would at once
// follow a target that these process data do not contain.
bool MotionAxis::waits_for_mode() const {
  return switched_on_ && fault_ == AxisFault::none && axis_.state() == PowerState::switched_on &&
         !mode_is(mode_of(Task::position));
}

// While a drive releases its brake, it keeps bit 12 at 0 and ignores targets. If bit 12 is never set, the drive counts
// as following after half the mode timeout.
bool MotionAxis::follows() {
  const bool says_so =
      !mode_is(OperationMode::cyclic_synchronous_position) || (axis_.statusword() & follows_target) != 0;
  cycles_not_following_ = says_so ? 0 : cycles_not_following_ + 1;
  return says_so || cycles_not_following_ > mode_timeout_cycles_ / 2;
}

void MotionAxis::supervise(bool fresh) {
  losses_ = fresh ? 0 : losses_ + 1;
  if (losses_ > options_.tolerated_losses) fail(AxisFault::communication_lost);
  following_error_ = enabled_ && task_ == Task::position ? acted_on_ - static_cast<double>(position_) : 0.0;
  if (options_.following_error_limit > 0.0 && std::abs(following_error_) > options_.following_error_limit) {
    fail(AxisFault::following_error);
  }
  const OperationMode wanted = mode_of(task_);
  cycles_without_mode_ = (enabled_ || waits_for_mode()) && !mode_is(wanted) ? cycles_without_mode_ + 1 : 0;
  if (cycles_without_mode_ > mode_timeout_cycles_) fail(AxisFault::mode_refused);
}

void MotionAxis::track_power() {
  const PowerState state = axis_.state();
  const bool broken = state == PowerState::fault || state == PowerState::fault_reaction_active;
  if (broken) {
    // Also applies while the axis is switched off, and if the drive reports a fault before this class detects one.
    fail(AxisFault::drive_fault);
  } else if (enabled_ && state != PowerState::operation_enabled) {
    fail(AxisFault::left_operation);
  }
  if (!switched_on_) enabled_ = false;
}

void MotionAxis::read(bool fresh) {
  if (fresh) {
    take_position();
    track_power();
  }
  supervise(fresh);
  if (enabled_ && task_ == Task::homing) run_homing();
}

// ---- Homing ----

bool MotionAxis::home() {
  if (!enabled_ || !axis_.can_command(OperationMode::homing)) return false;
  task_ = Task::homing;
  homing_ = Homing::starting;
  homing_cycles_ = 0;
  homed_ = false;
  return true;
}

void MotionAxis::abort_homing() {
  if (task_ != Task::homing) return;
  homing_ = Homing::breaking_off;
  homing_cycles_ = 0;
}

// The drive counts from its new origin, so the axis takes over that position.
void MotionAxis::end_homing() {
  task_ = Task::position;
  position_ = axis_.position();
  generator_.reset({static_cast<double>(position_), 0.0, 0.0});
  acted_on_ = sent_ = static_cast<double>(position_);
}

void MotionAxis::run_homing() {
  const HomingSignals& signals = options_.homing_signals;
  const std::uint16_t word = axis_.statusword();
  ++homing_cycles_;
  switch (homing_) {
    case Homing::starting:
      homing_cycles_ = 0;
      if (mode_is(OperationMode::homing)) homing_ = Homing::running;
      break;
    case Homing::running:
      if (homing_cycles_ < settling_cycles_) break;
      if ((word & signals.error) != 0) {
        fail(AxisFault::homing_failed);
      } else if ((word & signals.attained) != 0 &&
                 (!signals.target_reached || (word & status_bit::target_reached) != 0)) {
        homed_ = true;
        end_homing();
      }
      break;
    case Homing::breaking_off:
      if (homing_cycles_ < settling_cycles_) break;
      if ((word & status_bit::target_reached) != 0 || std::abs(velocity_) < 1.0) end_homing();
      break;
  }
}

// ---- Commands ----

// After velocity or torque mode the profile starts at the actual position and velocity.
bool MotionAxis::start(Task task) {
  if (!enabled_ || task_ == Task::homing || !axis_.can_command(mode_of(task))) return false;
  if (task_ != task && (task_ == Task::torque || task_ == Task::velocity) && task != Task::torque) {
    generator_.reset({static_cast<double>(position_), velocity_, 0.0});
  }
  if (task == Task::torque && task_ != Task::torque) torque_ = axis_.torque();
  if (task_ != task) cycles_without_mode_ = 0;
  task_ = task;
  return true;
}

bool MotionAxis::move_to(double target, double end_velocity, const MotionLimits& limits, SetPointGenerator::From from) {
  return start(Task::position) && generator_.move_to(target, end_velocity, limits, from);
}
bool MotionAxis::run_at(double velocity, const MotionLimits& limits, SetPointGenerator::From from) {
  return start(Task::position) && generator_.run_at(velocity, limits, from);
}
void MotionAxis::follow(const MotionState& next) {
  if (start(Task::position)) generator_.follow(next);
}
bool MotionAxis::run_in_velocity_mode(double velocity, const MotionLimits& limits) {
  return start(Task::velocity) && generator_.run_at(velocity, limits);
}
bool MotionAxis::apply_torque(double torque, double slope, double velocity_limit) {
  if (!std::isfinite(torque) || !(slope > 0.0) || !start(Task::torque)) return false;
  torque_target_ = torque;
  torque_slope_ = slope;
  torque_velocity_limit_ = velocity_limit;
  return true;
}

// ---- Outputs ----

void MotionAxis::advance() {
  if (!enabled_ || task_ == Task::homing) return;
  if (task_ == Task::torque) {
    const double step = torque_slope_ * generator_.period_s();
    torque_ += std::clamp(torque_target_ - torque_, -step, step);
    if (mode_is(mode_of(task_))) {
      generator_.reset({static_cast<double>(position_), velocity_, 0.0});
      return;
    }
  }
  generator_.advance();
}

double MotionAxis::limited_torque() const {
  const double limit = torque_velocity_limit_;
  if (!(limit > 0.0) || torque_ * velocity_ <= 0.0) return torque_;
  return torque_ * std::clamp((limit - std::abs(velocity_)) / (torque_taper * limit), 0.0, 1.0);
}

std::uint16_t MotionAxis::enabled_controlword() const {
  if (task_ == Task::homing) {
    if (homing_ == Homing::breaking_off) return command_word::enable_operation | start_homing | control_bit::halt;
    return homing_ == Homing::running ? command_word::enable_operation | start_homing : command_word::enable_operation;
  }
  const bool interpolates = task_ == Task::position && options_.position_mode == OperationMode::interpolated_position &&
                            mode_is(OperationMode::interpolated_position);
  return interpolates ? command_word::enable_operation | enable_interpolation : command_word::enable_operation;
}

void MotionAxis::write_targets() {
  const auto counts = static_cast<std::int32_t>(static_cast<std::uint32_t>(std::llround(set_point().position)));
  if (axis_.can_command(OperationMode::cyclic_synchronous_position)) axis_.set_target_position(counts);
  if (options_.position_mode == OperationMode::interpolated_position &&
      !axis_.can_command(OperationMode::cyclic_synchronous_position)) {
    axis_.set_interpolated_position(counts);
  }
  if (axis_.can_command(OperationMode::cyclic_synchronous_velocity)) {
    const double velocity = task_ == Task::velocity ? set_point().velocity * options_.velocity_scale : 0.0;
    axis_.set_target_velocity(static_cast<std::int32_t>(std::lround(velocity)));
  }
  if (axis_.can_command(OperationMode::cyclic_synchronous_torque)) {
    axis_.set_target_torque(task_ == Task::torque ? static_cast<std::int16_t>(std::lround(limited_torque()))
                                                  : std::int16_t{0});
  }
}

void MotionAxis::write() {
  if (resetting_ && axis_.reset_fault()) {
    resetting_ = false;
    fault_ = AxisFault::none;
    error_code_ = 0;
    losses_ = 0;
  }
  if (axis_.can_set_mode()) axis_.set_mode(mode_of(task_));
  if (!enabled_) {
    axis_.hold();
    acted_on_ = sent_ = static_cast<double>(position_);
    generator_.reset({static_cast<double>(position_), 0.0, 0.0});
    task_ = Task::position;
    if (resetting_) return;
    if (fault_ != AxisFault::none) {
      if (axis_.state() == PowerState::operation_enabled) axis_.set_controlword(command_word::quick_stop);
    } else if (!switched_on_) {
      axis_.disable();
    } else if (has_position_ && !waits_for_mode() && axis_.enable() && mode_is(mode_of(Task::position)) && follows()) {
      enabled_ = true;
      axis_.set_controlword(enabled_controlword());
    }
    return;
  }
  axis_.set_controlword(enabled_controlword());
  write_targets();
  acted_on_ = sent_;
  sent_ = set_point().position;
}

}  // namespace servodrome::master
