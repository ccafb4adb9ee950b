#include "axis/cyclic/motion_axis.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <limits>

#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"
#include "links/time.hpp"

namespace servodrome::master {

namespace {

// Fraction of the velocity limit over which the torque falls linearly to 0.
constexpr double torque_taper = 0.1;

// The nearest value of a target object; the drive would take a number beyond its type as one of the other sign.
template <typename Target>
Target nearest(double value) {
  using Range = std::numeric_limits<Target>;
  return static_cast<Target>(std::lround(std::clamp<double>(value, Range::min(), Range::max())));
}

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
    case AxisFault::not_following: return "the drive ignores its target position";
    case AxisFault::quick_stop: return "it was stopped by a quick stop";
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
    case AxisFault::not_following: return "see whether a limit switch or an input stops it, and move it away";
    case AxisFault::quick_stop: return "give the stop more time or a higher deceleration, and reset the fault";
  }
  return "";
}

MotionAxis::MotionAxis(const CyclicAxis& axis, Time period, const MotionAxisOptions& options)
    : axis_(axis),
      options_(options),
      generator_(links::to_seconds(period)),
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
  const std::int64_t before = has_position_ ? position_ : raw;
  if (!has_position_) {
    position_ = raw;
    has_position_ = true;
  } else {
    // The drive's position wraps at 32 bits, so the difference is taken modulo 2^32.
    position_ += static_cast<std::int32_t>(static_cast<std::uint32_t>(raw) - static_cast<std::uint32_t>(position_));
  }
  velocity_ = axis_.shows_velocity() ? axis_.velocity() / options_.velocity_scale
                                     : static_cast<double>(position_ - before) / generator_.period_s();
  // While the drive homes, its position also changes without a motion. Axes that follow this one wait.
  if (task_ == Task::homing) position_steps_ += static_cast<double>(position_ - before);
  ++resting_cycles_;
  if (std::abs(position_ - resting_place_) > options_.standstill_counts) {
    resting_place_ = position_;
    resting_cycles_ = 0;
  }
}

// The first fault is shown, except that a fault that prevents a reset replaces it.
void MotionAxis::fail(AxisFault fault) {
  if (fault_ != AxisFault::none && !resetting_) return;
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

bool MotionAxis::shows_following() const {
  return !mode_is(OperationMode::cyclic_synchronous_position) || (axis_.statusword() & master::follows_target) != 0;
}

// While a drive releases its brake, it keeps bit 12 at 0 and ignores targets. If bit 12 is never set, the drive counts
// as following after half the mode timeout.
bool MotionAxis::follows() {
  has_followed_ = shows_following();
  cycles_not_following_ = has_followed_ ? 0 : cycles_not_following_ + 1;
  if (!has_followed_ && cycles_not_following_ <= mode_timeout_cycles_ / 2) return false;
  cycles_not_following_ = 0;
  return true;
}

bool MotionAxis::stands() const { return resting_cycles_ >= settling_cycles_; }

// True while the drive brakes, or still needs the command to brake. A fault reset would cancel the stop.
bool MotionAxis::is_stopping() const {
  const PowerState state = axis_.state();
  return state == PowerState::operation_enabled || state == PowerState::fault_reaction_active ||
         (state == PowerState::quick_stop_active && !stands());
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
  // If a drive stops following its target, as at a limit switch, it would later move to a target that is no longer
  // wanted.
  if (!enabled_ || task_ != Task::position || !fresh) return;
  has_followed_ = has_followed_ || shows_following();
  cycles_not_following_ = has_followed_ && !shows_following() ? cycles_not_following_ + 1 : 0;
  const Time ignored = cycles_not_following_ * links::from_seconds(generator_.period_s());
  if (options_.following_timeout > Time{0} && ignored > options_.following_timeout) fail(AxisFault::not_following);
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
}

void MotionAxis::read(bool fresh) {
  fresh_ = fresh;
  if (!switched_on_) enabled_ = false;
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
  mode_changes_ = true;
  homing_ = Homing::starting;
  homing_cycles_ = 0;
  homed_ = false;
  return true;
}

void MotionAxis::abort_homing() {
  if (task_ != Task::homing || homing_ == Homing::breaking_off) return;
  if (homing_ == Homing::starting) {
    // The drive has not received the start of homing. The controlword of a halt would start it, because it contains
    // bit 4.
    task_ = Task::position;
    resting_set_point_ = set_point().position;
    return;
  }
  homing_ = Homing::breaking_off;
  homing_cycles_ = 0;
}

// After a completed homing the drive counts from its new origin, so the axis takes over that position.
void MotionAxis::end_homing(bool attained) {
  task_ = Task::position;
  if (attained) {
    position_steps_ += static_cast<double>(axis_.position() - position_);
    position_ = resting_place_ = axis_.position();
    velocity_ = 0.0;
  }
  follows_actual_ = false;
  follow_actual(0.0);
  acted_on_ = sent_ = static_cast<double>(position_);
  resting_set_point_ = set_point().position;
}

void MotionAxis::run_homing() {
  const catalogue::HomingSignals& signals = options_.homing_signals;
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
        end_homing(true);
      }
      break;
    case Homing::breaking_off:
      if (homing_cycles_ < settling_cycles_) break;
      if ((word & status_bit::target_reached) != 0 || std::abs(velocity_) < 1.0) {
        end_homing(false);
      } else if (homing_cycles_ > 2 * mode_timeout_cycles_) {
        fail(AxisFault::homing_failed);
      }
      break;
  }
}

// ---- Commands ----

// Lets the set-point be the actual position, and forgets the profile.
void MotionAxis::follow_actual(double velocity) {
  note_step();
  generator_.reset({static_cast<double>(position_), velocity, 0.0});
}

// The set-point becomes the actual position, if it is not already.
void MotionAxis::note_step() {
  if (!follows_actual_) set_point_steps_ += static_cast<double>(position_) - generator_.state().position;
  follows_actual_ = true;
}

// After velocity or torque mode the profile starts at the actual position and velocity.
bool MotionAxis::start(Task task) {
  if (!enabled_ || task_ == Task::homing || !axis_.can_command(mode_of(task))) return false;
  if (task_ != task && (task_ == Task::torque || task_ == Task::velocity) && task != Task::torque) {
    follow_actual(velocity_);
  }
  if (task == Task::torque && task_ != Task::torque) torque_ = axis_.torque();
  if (task_ != task) {
    cycles_without_mode_ = 0;
    mode_changes_ = true;
  }
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
  const bool in_mode = mode_is(mode_of(task_));
  if (task_ == Task::torque && in_mode) {
    mode_changes_ = false;
    const double step = torque_slope_ * generator_.period_s();
    torque_ += std::clamp(torque_target_ - torque_, -step, step);
    follow_actual(velocity_);
    return;
  }
  mode_changes_ = mode_changes_ && !in_mode;
  if (!mode_changes_ || task_ != Task::position) resting_set_point_.reset();
  if (task_ == Task::position && mode_changes_) {
    // The drive is still in the previous mode. The profile starts again in each cycle, until the drive is in the new
    // mode.
    if (resting_set_point_) {
      generator_.restart({*resting_set_point_, 0.0, 0.0});
      return;
    }
    note_step();
    generator_.restart({static_cast<double>(position_), velocity_, 0.0});
    generator_.advance();
    return;
  }
  follows_actual_ = false;
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
    // Until the drive has left velocity mode, it keeps its velocity.
    const bool runs = task_ == Task::velocity || mode_is(OperationMode::cyclic_synchronous_velocity);
    const double velocity = runs ? set_point().velocity * options_.velocity_scale : 0.0;
    axis_.set_target_velocity(nearest<std::int32_t>(velocity));
  }
  if (axis_.can_command(OperationMode::cyclic_synchronous_torque)) {
    axis_.set_target_torque(task_ == Task::torque ? nearest<std::int16_t>(limited_torque()) : std::int16_t{0});
  }
}

void MotionAxis::cancel_reset() {
  if (!resetting_) return;
  resetting_ = false;
  if (axis_.controlword() == command_word::fault_reset) axis_.set_controlword(command_word::disable_voltage);
}

// The controlword of an axis that does not follow set-points: because of a fault, switched off, or not enabled yet.
void MotionAxis::write_while_off() {
  const PowerState state = axis_.state();
  if (resetting_ && fresh_ && !is_stopping() && axis_.reset_fault()) {
    resetting_ = false;
    fault_ = AxisFault::none;
    error_code_ = 0;
    losses_ = 0;
  }
  if (fault_ != AxisFault::none) {
    // A word that enables must not stay in the process data: the drive would follow it as soon as it can.
    if (state == PowerState::operation_enabled || commands_operation(axis_.controlword())) {
      axis_.set_controlword(command_word::quick_stop);
    } else if (!switched_on_ && fresh_ && state == PowerState::quick_stop_active && stands()) {
      axis_.disable();
    }
    return;
  }
  const bool is_on = state == PowerState::operation_enabled || state == PowerState::quick_stop_active ||
                     state == PowerState::switched_on;
  if (!switched_on_ || must_go_off_) {
    axis_.disable();
    must_go_off_ = must_go_off_ && (is_on || !fresh_);
    return;
  }
  if (!fresh_ || !has_position_ || waits_for_mode()) return;
  if (!axis_.enable() || !mode_is(mode_of(Task::position)) || !follows()) return;
  enabled_ = true;
  mode_changes_ = false;
  axis_.set_controlword(enabled_controlword());
}

void MotionAxis::write() {
  if (!switched_on_) enabled_ = false;
  if (!enabled_) task_ = Task::position;
  if (axis_.can_set_mode()) axis_.set_mode(mode_of(task_));
  if (!enabled_) {
    axis_.hold();
    acted_on_ = sent_ = static_cast<double>(position_);
    follow_actual(0.0);
    write_while_off();
    return;
  }
  resetting_ = false;
  axis_.set_controlword(enabled_controlword());
  write_targets();
  acted_on_ = sent_;
  sent_ = set_point().position;
}

}  // namespace servodrome::master
