#include "drive/modes/velocity_modes.hpp"

#include <utility>

#include "drive/power/power_state.hpp"

namespace servodrome::drive {

namespace {

// Plans the ramp to a speed. Returns false if the axis would have to accelerate with a ramp of 0. Slowing down is
// always possible: with `quick_stop` (counts/s^2) if the deceleration is 0, and at once if that is 0 as well.
bool plan_velocity(Axis& axis, double target, MotionLimits limits, double quick_stop, RampShape shape) {
  Generator& generator = axis.generator;
  const double shaft = axis.velocity();
  const bool slows = std::abs(target) < std::abs(generator.velocity()) || target * generator.velocity() < 0.0;
  if (slows && std::abs(shaft) < std::abs(generator.velocity()) && !axis.follows_demand()) {
    generator.start_from(axis.position(), shaft);  // braking begins with the actual speed
  }
  const double velocity = generator.velocity();
  const bool turns = target * velocity < 0.0;
  const bool possible = limits.acceleration > 0.0 || (!turns && std::abs(target) <= std::abs(velocity));
  if (!possible) target = turns ? 0.0 : velocity;
  if (limits.deceleration <= 0.0) limits.deceleration = quick_stop;
  if (limits.deceleration <= 0.0) {
    if (slows) generator.start_from(axis.position(), turns ? 0.0 : target);
    limits.deceleration = limits.acceleration;
  }
  if (limits.acceleration <= 0.0) limits.acceleration = limits.deceleration;
  if (limits.jerk <= 0.0 && shape == RampShape::jerk_limited) shape = RampShape::linear;
  const Trajectory::Result result = generator.run_at(target, limits, shape);
  if (result == Trajectory::Result::bad_limits) generator.start_from(axis.position(), target);
  return possible;
}

}  // namespace

// --- Profile velocity

void ProfileVelocity::enter(Axis& axis) {
  planned_ = false;
  given_up_ = false;
  wanted_ = 0.0;
  slipping_ = clipped_ = false;
  windows_.restart();
  axis.limited = false;
}

Cause ProfileVelocity::planning_fault(const Axis& axis, RampShape shape) const {
  const Objects& objects = axis.objects;
  const bool zeros = axis.policy.ramps.zeros_are_faults;
  const bool no_deceleration = objects.profile_deceleration == 0 || objects.quick_stop_deceleration == 0;
  const bool jerk_limited = shape == RampShape::jerk_limited;
  return axis.first_monitored({
      {!axis.has_shape(objects.motion_profile_type), Cause::motion_profile_type},
      {!axis.has_shape(axis.configuration.velocity_stop_shape), Cause::velocity_ramp_type},
      {zeros && objects.profile_acceleration == 0, Cause::profile_acceleration_zero},
      {zeros && no_deceleration, Cause::velocity_deceleration_zero},
      {zeros && jerk_limited && objects.profile_jerk[0] == 0, Cause::profile_value_zero},
      // A stop always begins in motion, so it may be jerk-limited.
      {axis.policy.ramps.jerk_limited_only_from_standstill && jerk_limited && objects.target_velocity != 0 &&
           !axis.generator.standing(),
       Cause::jerk_limited_while_moving},
  });
}

ProfileVelocity::Request ProfileVelocity::request_of(const Axis& axis) {
  const Objects& objects = axis.objects;
  return {objects.target_velocity,
          axis.ramp(objects.profile_acceleration, objects.max_acceleration),
          axis.profile_deceleration(),
          objects.profile_jerk[0],
          objects.motion_profile_type,
          axis.max_velocity(true),
          axis.active(Signal::invert_direction)};
}

double ProfileVelocity::velocity_of(const Request& request, const Axis& axis) {
  const double velocity = axis.units.velocity_to_counts(request.target);
  return request.inverted ? -velocity : velocity;
}

// The limit ended the motion to the present target, unless this target leads away from the limit. This is also right if
// the mode was entered during a halt and has not planned a motion yet.
void ProfileVelocity::interrupt(Axis& axis, int direction) {
  request_ = request_of(axis);
  wanted_ = velocity_of(request_, axis);
  given_up_ = planned_ = wanted_ * direction >= 0.0;
}

void ProfileVelocity::step(Axis& axis) {
  const Request request = request_of(axis);
  const bool same_target = planned_ && request.target == request_.target && request.inverted == request_.inverted;
  // A target that a limit has ended does not start again, but a lowered speed limit still applies.
  const bool keeps_given_up = given_up_ && same_target;
  const bool obeys = std::abs(axis.generator.velocity()) <= request.allowed;
  if (!planned_ || (request != request_ && !(keeps_given_up && obeys))) {
    const RampShape shape = request.target == 0 ? axis.velocity_stop_shape() : axis.shape();
    // Standing still with target 0 needs no plan, so it cannot be a planning fault.
    if (request.target != 0 || !axis.generator.standing()) axis.raise(planning_fault(axis, shape));
    planned_ = true;
    wanted_ = velocity_of(request, axis);
    const double target = std::clamp(wanted_, -request.allowed, request.allowed);
    axis.limited = clipped_ = target != wanted_;
    MotionLimits limits = axis.profile_limits();
    limits.velocity = request.allowed;
    given_up_ = !plan_velocity(axis, target, limits, axis.quick_stop_ramp(), shape) || keeps_given_up;
    windows_.changed();
  }
  request_ = request;
  // A limit switch does not limit an axis whose target is standstill.
  if (given_up_ && wanted_ == 0.0) axis.limited = false;
  if (clipped_) axis.exceed_velocity(Mode::profile_velocity);
  axis.generator.step(axis.cycle_s);
  axis.follow_generator(loop);
  observe(axis);
}

void ProfileVelocity::observe(Axis& axis) {
  windows_.update(axis, wanted_, axis.generator.finished() && !given_up_);
  if (!axis.policy.status.slippage) return;
  // On a ramp the shown velocity is compared with the demand at the time of its measurement.
  const double shown_goal = axis.generator.velocity() - axis.generator.acceleration() * axis.shown_velocity_lag_s();
  slipping_ = std::abs(axis.shown_velocity() - shown_goal) > axis.objects.max_slippage * axis.units.velocity;
}

std::uint16_t ProfileVelocity::status(const Axis&) const {
  return windows_.status() | (slipping_ ? statusword::mode_bit_13 : std::uint16_t{0});
}

void VelocityWindows::update(const Axis& axis, double goal, bool arrived) {
  const Objects& objects = axis.objects;
  const double velocity = axis.shown_velocity();
  const double error = std::abs(velocity - goal);
  const SpeedWindows& own = axis.configuration.speed_windows;
  if (own.used) {
    target_reached_ = error < own.reached_counts_per_s;  // 60FFh less actual velocity only
    speed_zero_ = axis.lasts(std::abs(axis.counts_per_ms) <= own.zero_counts_per_ms, zero_, own.zero_ms);
    return;
  }
  const bool windowed = objects.velocity_window != 0xFFFF;
  const bool inside = arrived && (!windowed || error <= objects.velocity_window * axis.units.velocity);
  target_reached_ = axis.lasts(inside, window_, windowed ? objects.velocity_window_time_ms : 0);
  if (std::abs(velocity) < objects.velocity_threshold * axis.units.velocity) {
    zero_.reset();
    speed_zero_ = true;
  } else if (axis.lasts(true, zero_, objects.velocity_threshold_time_ms)) {
    speed_zero_ = false;
  }
}

std::uint16_t VelocityWindows::status() const {
  std::uint16_t bits = 0;
  if (target_reached_) bits |= statusword::target_reached;
  if (speed_zero_) bits |= statusword::mode_bit_12;
  return bits;
}

// --- Immediate velocity

double ImmediateVelocity::target(const Axis& axis) {
  const double wanted = axis.units.velocity_to_counts(axis.objects.target_velocity);
  return axis.active(Signal::invert_direction) ? -wanted : wanted;
}

void ImmediateVelocity::enter(Axis& axis) {
  windows_.restart();
  axis.limited = held_ = false;
}

void ImmediateVelocity::step(Axis& axis) {
  const double wanted = target(axis);
  const double allowed = axis.max_velocity(true);
  held_ = held_ && wanted == wanted_;
  wanted_ = wanted;
  const double velocity = held_ ? 0.0 : std::clamp(wanted, -allowed, allowed);
  axis.limited = velocity != wanted;
  axis.generator.place(axis.position(), 0.0, velocity);
  axis.follow_generator(loop);
  observe(axis);
}

// --- Velocity mode (vl)

namespace {

double ratio(std::int32_t numerator, std::int32_t denominator) { return static_cast<double>(numerator) / denominator; }

double set_point_factor(const Objects& objects) {
  return ratio(objects.vl_set_point_factor_numerator, objects.vl_set_point_factor_denominator);
}

// Counts/s per vl velocity unit: velocity in rpm = velocity in user units x (604Ch). The limits 6046h and the ramps are
// in this unit; the set-point and its two displays are scaled by 604Bh on top.
double velocity_unit(const Axis& axis) {
  const Objects& objects = axis.objects;
  return axis.rpm_to_counts_per_s(1.0) *
         ratio(objects.vl_dimension_factor_numerator, objects.vl_dimension_factor_denominator);
}

// `greatest`: 60C5h or 60C6h; 0: no limit.
double ramp(const Axis& axis, std::uint32_t delta_speed, std::uint16_t delta_time_s, std::uint32_t greatest) {
  // Delta time 0: as fast as possible.
  const double speed = std::abs(delta_speed * velocity_unit(axis));
  const double slope = delta_time_s == 0 ? speed * 1e4 : speed / delta_time_s;
  return greatest == 0 ? slope : std::min(slope, greatest * axis.units.acceleration);
}

}  // namespace

double VelocityMode::to_vl(const Axis& axis, double counts_per_s) {
  const double vl_velocity = counts_per_s / (velocity_unit(axis) * set_point_factor(axis.objects));
  return axis.units.velocity_inverted ? -vl_velocity : vl_velocity;
}

double VelocityMode::deceleration(const Axis& axis) const {
  return ramp(axis, axis.objects.vl_deceleration_delta_speed, axis.objects.vl_deceleration_delta_time_s,
              axis.objects.max_deceleration);
}

double VelocityMode::quick_stop_deceleration(const Axis& axis) const {
  return ramp(axis, axis.objects.vl_quick_stop_delta_speed, axis.objects.vl_quick_stop_delta_time_s,
              axis.objects.max_deceleration);
}

void VelocityMode::enter(Axis& axis) {
  planned_ = false;
  ramped_ = false;
  blocked_ = false;
  word_ = axis.controlword;
  axis.limited = false;
}

// Controlword bit 4: the ramp function generator runs, else the demand ramps down to zero; bit 5: its output follows,
// else it is locked; bit 6: its input is the set-point, else zero. Until this mode has commanded a velocity there is
// no output to lock, and the motion of an earlier mode comes to rest.
bool VelocityMode::runs() const { return (word_ & controlword::mode_bit_4) != 0; }
bool VelocityMode::locks() const { return runs() && (word_ & controlword::mode_bit_5) == 0; }

VelocityMode::Input VelocityMode::input(const Axis& axis) const {
  const Objects& objects = axis.objects;
  if (!runs() || locks() || (word_ & controlword::mode_bit_6) == 0) return {};
  const double unit = velocity_unit(axis);
  const double target = objects.vl_target_velocity * set_point_factor(objects) * unit;
  const double least = std::abs(objects.vl_velocity_min_amount * unit);
  const double most = std::min(std::abs(objects.vl_velocity_max_amount * unit), axis.max_velocity(false));
  const double magnitude =
      objects.vl_target_velocity == 0 ? 0.0 : std::clamp(std::abs(target), std::min(least, most), most);
  const double velocity = std::copysign(magnitude, target);
  return {axis.units.velocity_inverted ? -velocity : velocity, magnitude != std::abs(target)};
}

void VelocityMode::interrupt(Axis& axis, int direction) {
  target_ = input(axis).velocity;
  blocked_ = planned_ = target_ * direction >= 0.0;
}

void VelocityMode::step(Axis& axis) {
  const Objects& objects = axis.objects;
  const bool locked = locks() && ramped_;
  ramped_ |= !locks();
  const auto [target, limited] = input(axis);
  axis.limited = blocked_ || limited;
  const MotionLimits limits{
      axis.max_velocity(false),
      ramp(axis, objects.vl_acceleration_delta_speed, objects.vl_acceleration_delta_time_s, objects.max_acceleration),
      deceleration(axis), 1.0};
  if (locked) {
    if (planned_) axis.generator.start_from(axis.generator.nearest_position(), axis.generator.velocity());
    planned_ = false;
  } else if (!planned_ || target != target_ ||
             (!blocked_ &&
              (limits.acceleration != limits_.acceleration || limits.deceleration != limits_.deceleration))) {
    blocked_ = !plan_velocity(axis, target, limits, quick_stop_deceleration(axis), RampShape::linear);
    planned_ = true;
    target_ = target;
    limits_ = limits;
  }
  axis.generator.step(axis.cycle_s);
  axis.follow_generator(loop);
}

// --- Profile torque

void ProfileTorque::enter(Axis& axis) {
  begun_ = target_reached_ = false;
  axis.limited = false;
}

// At rest the torque begins with the load that the loops held. While the axis moves, the computed load may in fact be
// the torque that brakes the axis, because the inertia is not known. It must not drive the axis on, so only the part in
// the direction of the target is kept. The mode begins with its first step, not when it is entered: the load may come
// only between, when the brake opens.
void ProfileTorque::begin(const Axis& axis) {
  const LoopDemand& demand = axis.demand;
  const float sense = axis.units.velocity_inverted ? -1.0F : 1.0F;
  if (demand.loop == Loop::torque) return begin_at(sense * demand.torque);
  const float load = sense * axis.loops->load_torque;
  const bool held = demand.loop == Loop::locked || axis.follows_demand();
  const bool rests = axis.shaft_stands && demand.velocity == 0.0F && held;
  begin_at(rests ? load : std::clamp(load, std::min(0.0F, target(axis)), std::max(0.0F, target(axis))));
}

float ProfileTorque::target(const Axis& axis) {
  const float wanted = static_cast<float>(axis.objects.target_torque) * 0.001F;
  return axis.active(Signal::invert_direction) ? -wanted : wanted;
}

void ProfileTorque::begin_at(float torque) {
  demand_ = start_ = goal_ = torque;
  phase_ = 1.0F;
}

void ProfileTorque::step(Axis& axis) {
  if (!std::exchange(begun_, true)) begin(axis);
  const Objects& objects = axis.objects;
  const float target = ProfileTorque::target(axis);
  const float slope = static_cast<float>(objects.torque_slope) * 0.001F;
  const auto cycle = static_cast<float>(axis.cycle_s);
  // Products with this fault have the linear type only; without it this call has no effect.
  if (objects.torque_profile_type != 0) axis.raise(Cause::torque_profile_type);
  if (slope <= 0.0F) {
    begin_at(target);  // no slope set: a step
  } else if (objects.torque_profile_type == 1) {
    if (target != goal_) {
      start_ = demand_;
      goal_ = target;
      phase_ = 0.0F;
    }
    const float span = goal_ - start_;
    // The steepest point of the sin2 ramp has the slope 6087h.
    const float duration = std::abs(span) / slope * 1.57079633F;
    phase_ = duration > 0.0F ? std::min(1.0F, phase_ + cycle / duration) : 1.0F;
    const float s = sin_cos(phase_of(phase_ * 0.25F)).sine;
    demand_ = start_ + span * s * s;
  } else {
    const float step = slope * cycle;
    begin_at(demand_ + std::clamp(target - demand_, -step, step));
  }
  keep_to_limits(axis);
  target_reached_ = demand_ == target;
  demand_torque(axis);
}

// A ramp that reaches a limit of the torque begins again at the limit. Otherwise it would first have to come back from
// beyond the limit.
void ProfileTorque::keep_to_limits(Axis& axis) {
  const LoopDemand& demand = axis.demand;
  if (demand.loop == Loop::off) return;  // enabled in this cycle: the limits are not known yet
  const bool inverted = axis.units.velocity_inverted;
  const MotorData& motor = axis.configuration.motor;
  const float peak = motor.peak_current_a * motor.torque_constant_nm_per_a / motor.rated_torque_nm;
  const float most = inverted ? demand.torque_limit_negative : demand.torque_limit_positive;
  const float least = inverted ? demand.torque_limit_positive : demand.torque_limit_negative;
  const float allowed = std::clamp(demand_, -std::min(least, peak), std::min(most, peak));
  axis.limited = allowed != demand_;
  if (axis.limited) begin_at(allowed);
}

void ProfileTorque::demand_torque(Axis& axis) const {
  axis.generator.start_from(axis.position(), axis.velocity());
  axis.demand.loop = loop;
  axis.demand.torque = axis.units.velocity_inverted ? -demand_ : demand_;
}

std::uint16_t ProfileTorque::status(const Axis&) const {
  return target_reached_ ? statusword::target_reached : std::uint16_t{0};
}

}  // namespace servodrome::drive
