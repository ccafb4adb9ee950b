#include "drive/modes/profile_position.hpp"

#include "drive/power/power_state.hpp"

namespace servodrome::drive {

namespace {

// 60F2h bits 0 and 1: the reference of a relative set-point.
constexpr std::uint16_t relative_to_demand = 1;
constexpr std::uint16_t relative_to_actual = 2;

// For products that come to rest between set-points: the shaft stands when it has been slower than this for this time.
// If it keeps moving, the next set-point begins after `rest_wait_ms`.
constexpr double standing_rpm = 1.0;
constexpr std::uint32_t standing_ms = 2;
constexpr std::uint32_t rest_wait_ms = 2000;

}  // namespace

void ProfilePosition::enter(Axis& axis) {
  axis.commanded.reset();
  axis.new_set_point = false;  // a target that was written before does not start a motion in this mode
  head_ = count_ = 0;
  immediate_pending_ = false;
  running_ = false;
  passing_ = false;
  braking_ = false;
  acknowledge_ = false;
  given_ = false;
  interrupted_ = !axis.generator.standing();  // the axis moves on, so it will not rest at its present position
  target_reached_ = !interrupted_;
  window_.reset();
  target_ = axis.generator.nearest_position();
  target_user_ = axis.units.to_user(target_);
  axis.come_to_rest(axis.shape());  // this mode has no target yet, so any motion ends
}

ProfilePosition::SetPoint ProfilePosition::capture(const Axis& axis, std::uint16_t word) const {
  const Objects& objects = axis.objects;
  const RampShape shape = axis.shape();
  const bool symmetric = shape == RampShape::jerk_limited && axis.policy.ramps.jerk_limited_single_symmetric;
  const double end = objects.end_velocity * axis.units.velocity;
  const bool starts = axis.policy.positioning.end_velocity_is_start;
  return {.target = objects.target_position,
          .relative = (word & controlword::mode_bit_6) != 0,
          .pass_previous = (word & controlword::mode_bit_9) != 0,
          .velocity = objects.profile_velocity * axis.units.velocity,
          .end_velocity = symmetric || starts ? 0.0 : end,
          .start_velocity = starts ? end : 0.0,
          .acceleration = objects.profile_acceleration,
          .deceleration = symmetric ? objects.profile_acceleration : objects.profile_deceleration,
          .jerk = objects.profile_jerk[0],
          .shape = shape,
          .option = objects.positioning_option_code};
}

void ProfilePosition::controlword(Axis& axis, std::uint16_t before, std::uint16_t now) {
  const bool rising = (now & controlword::mode_bit_4) != 0 && (before & controlword::mode_bit_4) == 0;
  if ((now & controlword::mode_bit_4) == 0) acknowledge_ = false;
  if (!rising || ((now & controlword::halt) != 0 && axis.policy.positioning.halt_discards)) return;
  if ((now & controlword::mode_bit_5) != 0) {
    if (axis.policy.positioning.acknowledge_blocks_change && !room(axis)) return;
    count_ = 0;
    immediate_ = capture(axis, now);
    immediate_pending_ = true;
  } else if (room(axis)) {
    queue_[(head_ + count_++) % capacity] = capture(axis, now);
  } else {
    return;  // the queue is full: the set-point is ignored, and statusword bit 12 stays set
  }
  acknowledge_ = true;
  target_reached_ = false;
}

ProfilePosition::SetPoint ProfilePosition::pop() {
  const SetPoint set_point = queue_[head_];
  head_ = (head_ + 1) % capacity;
  --count_;
  return set_point;
}

// Returns true if the waiting set-point may begin after the one whose demand has just ended.
bool ProfilePosition::may_chain(const Axis& axis) {
  if (!axis.policy.positioning.starts_from_rest || running_set_point_.end_velocity > 0.0 || passing_) return true;
  const bool slow = std::abs(axis.velocity()) < axis.rpm_to_counts_per_s(standing_rpm);
  const bool stands = axis.lasts(slow, rest_, standing_ms);
  if (!stands && ++rest_wait_cycles_ < axis.cycles(rest_wait_ms)) return false;
  return true;
}

// Only causes that the product has as faults refuse the set-point. Otherwise an end velocity above the profile velocity
// is clipped, and contradicting limits (607Bh, 607Dh) have no effect.
Cause ProfilePosition::planning_fault(const Axis& axis, const SetPoint& set_point) const {
  const Objects& objects = axis.objects;
  const std::int32_t least = objects.min_position_limit;
  const std::int32_t greatest = objects.max_position_limit;
  const std::int32_t range_least = objects.min_position_range_limit;
  const std::int32_t range_greatest = objects.max_position_range_limit;
  const bool limits_set = least != 0 || greatest != 0;
  const bool range_set = range_least != 0 || range_greatest != 0;
  const bool leaves_range = range_set && (least < range_least || greatest > range_greatest);
  const bool zeros = axis.policy.ramps.zeros_are_faults;
  const bool no_velocity = zeros && set_point.velocity <= 0.0;
  const bool no_acceleration = zeros && set_point.acceleration == 0;
  const bool no_deceleration = zeros && set_point.deceleration == 0;
  const bool jerk_limited = set_point.shape == RampShape::jerk_limited;
  return axis.first_monitored({
      {!axis.has_shape(objects.motion_profile_type), Cause::motion_profile_type},
      {range_set && range_least >= range_greatest, Cause::range_limits_wrong},
      {limits_set && (least >= greatest || leaves_range), Cause::software_limits_wrong},
      {set_point.pass_previous && (no_velocity || no_acceleration || no_deceleration), Cause::profile_multi_point},
      {no_velocity, Cause::profile_velocity_zero},
      {no_acceleration, Cause::profile_acceleration_zero},
      {no_deceleration || (zeros && objects.quick_stop_deceleration == 0), Cause::position_deceleration_zero},
      {zeros && jerk_limited && set_point.jerk == 0, Cause::profile_value_zero},
      {set_point.end_velocity > set_point.velocity, Cause::end_velocity_above_profile},
      {axis.policy.ramps.jerk_limited_only_from_standstill && jerk_limited && !axis.generator.standing(),
       Cause::jerk_limited_while_moving},
  });
}

bool ProfilePosition::resolve_target(Axis& axis, const SetPoint& set_point, Counts& target) {
  std::int64_t user = set_point.target;
  Counts base_remainder = 0;  // remainder of a reference in counts, because of user units
  if (set_point.relative) {
    // The target of an interrupted motion is not the reference of a relative set-point.
    const std::uint16_t asked = set_point.option & 3u;
    const std::uint16_t relative_to = interrupted_ && asked != relative_to_actual ? relative_to_demand : asked;
    if (relative_to == relative_to_demand || relative_to == relative_to_actual) {
      const Counts base = relative_to == relative_to_demand ? axis.generator.nearest_position() : axis.position();
      const std::int64_t base_user = axis.units.to_user(base);
      base_remainder = base - axis.units.to_counts(base_user);
      user += base_user;
    } else {
      user += target_user_;
    }
  } else if (const std::int64_t range = axis.position_range(); range != 0) {
    // A target beyond one end of the range wraps to the other; 60F2h bits 6 and 7 select the direction.
    const std::int64_t low = axis.objects.min_position_range_limit;
    const std::int64_t now = axis.units.to_user(axis.generator.nearest_position());
    const auto wrapped = [low, range](std::int64_t value) {
      const std::int64_t within = (value - low) % range;
      return low + (within < 0 ? within + range : within);
    };
    std::int64_t distance = wrapped(user) - wrapped(now);
    const unsigned direction = (set_point.option >> 6) & 3u;
    if (direction == 1 && distance > 0) distance -= range;  // negative only
    if (direction == 2 && distance < 0) distance += range;  // positive only
    if (direction == 3) {                                   // the shortest way; half a turn goes positive
      if (2 * distance > range) distance -= range;
      if (2 * distance <= -range) distance += range;
    }
    // The other direction leads through positions that 607Dh forbids.
    user = axis.limits_bound_range() ? axis.turn_of_demand() + wrapped(user) : now + distance;
  } else {
    // 6064h shows 32 bits of the position: an absolute target is in the present turn of that counter.
    const std::int64_t now = axis.units.to_user(axis.generator.nearest_position());
    user += now - wrap_to_32_bits(now);
  }
  axis.limited = false;
  axis.commanded = user - axis.turn_of_demand();
  if (axis.software_limits_active()) {
    const std::int64_t clipped = axis.within_limits_of_turn(user);
    if (clipped != user) {
      if (axis.policy.limits.target_beyond == OutOfLimits::fault) {
        axis.raise(Cause::position_limit);
        return false;
      }
      user = clipped;
      base_remainder = 0;
      axis.limited = true;
    }
  }
  target_user_ = user;
  target = axis.units.to_counts(user) + base_remainder;
  return true;
}

void ProfilePosition::start(Axis& axis, const SetPoint& set_point, bool chained) {
  if (const Cause cause = planning_fault(axis, set_point); cause != Cause::none) {
    axis.raise(cause);
    running_ = false;
    return;
  }
  const bool clipped = set_point.velocity > axis.max_velocity(true) * (1.0 + 1e-9);
  if (clipped) {
    axis.exceed_velocity(Mode::profile_position);
    if (axis.raised == Cause::velocity_excessive) {
      running_ = false;
      return;
    }
  }
  Counts target = 0;
  if (!resolve_target(axis, set_point, target)) {
    running_ = false;
    return;
  }
  axis.limited = axis.limited || clipped;
  plan(axis, set_point, target, chained);
}

// Starts an axis at rest with its start speed, or with less if the way is too short to stop from it.
bool ProfilePosition::start_at_speed(Axis& axis, const SetPoint& set_point, Counts target, const MotionLimits& limits) {
  if (set_point.start_velocity <= 0.0 || !axis.generator.standing()) return false;
  const Counts from = axis.generator.nearest_position();
  const auto way = static_cast<double>(target - from);
  const double stopping = std::sqrt(2.0 * std::abs(way) * limits.deceleration);
  const double speed = std::min({set_point.start_velocity, limits.velocity, stopping});
  if (speed <= 0.0) return false;
  axis.generator.start_from(from, std::copysign(speed, way));
  return true;
}

void ProfilePosition::plan(Axis& axis, const SetPoint& set_point, Counts target, bool chained) {
  if (axis.demand.loop == Loop::locked) axis.take_over_slipped();
  const MotionLimits limits =
      axis.limits(set_point.velocity, set_point.acceleration, set_point.deceleration, set_point.jerk);
  allowed_ = axis.max_velocity(true);
  planned_ = limits;
  // A target at a software limit: the motion ends there, so the end velocity is 0.
  const double end_velocity = axis.at_software_limit(axis.to_user_position(target)) ? 0.0 : set_point.end_velocity;
  const auto way = static_cast<double>(target - axis.generator.nearest_position());
  direction_ = std::copysign(1.0, way != 0.0 ? way : axis.generator.velocity());
  const bool from_rest = start_at_speed(axis, set_point, target, limits);
  const Trajectory::Result result = chained && !from_rest
                                        ? axis.generator.continue_to(target, end_velocity, limits, set_point.shape)
                                        : axis.generator.move_to(target, end_velocity, limits, set_point.shape);
  // A profile without velocity or acceleration cannot run: the present motion is aborted, and the axis rests before its
  // target until it gets a usable set-point.
  running_ = result != Trajectory::Result::bad_limits && result != Trajectory::Result::bad_state;
  if (!running_) axis.come_to_rest(axis.shape());
  target_ = target;
  running_set_point_ = set_point;
  running_set_point_.end_velocity = end_velocity;
  passing_ = false;
  given_ = true;
  interrupted_ = !running_;
  target_reached_ = false;
  window_.reset();
  rest_.reset();
  rest_wait_cycles_ = 0;
}

// With a manufacturer's bit of the controlword, every write of an absolute target is a new set-point.
void ProfilePosition::track(Axis& axis) {
  const std::uint16_t word = axis.controlword;
  const std::uint16_t needed = axis.policy.positioning.target_tracking | controlword::mode_bit_4;
  if (axis.policy.positioning.target_tracking != 0 && axis.new_set_point && (word & needed) == needed &&
      (word & controlword::mode_bit_6) == 0) {
    count_ = 0;
    immediate_ = capture(axis, word);
    immediate_pending_ = true;
  }
  axis.new_set_point = false;
}

void ProfilePosition::step(Axis& axis) {
  track(axis);
  if (brakes_before_limit(axis)) return;
  keep_to_limits(axis);
  keep_to_profile(axis);
  if (immediate_pending_) {
    immediate_pending_ = false;
    start(axis, immediate_, false);
  } else if (count_ > 0 && (!running_ || (axis.generator.finished() && may_chain(axis)))) {
    const bool chained = running_;
    start(axis, pop(), chained);
  } else if (count_ > 0 && queue_[head_].pass_previous && !passing_ &&
             !axis.at_software_limit(axis.to_user_position(target_))) {
    const SetPoint& current = running_set_point_;
    axis.generator.move_to(target_, current.velocity,
                           axis.limits(current.velocity, current.acceleration, current.deceleration, current.jerk),
                           current.shape);
    passing_ = true;
  }
  brake_before_limit(axis);
  axis.generator.step(axis.cycle_s);
  if (axis.generator.finished() && !interrupted_ && count_ == 0 && !immediate_pending_) {
    if (running_) running_ = running_set_point_.end_velocity > 0.0;
    const std::uint32_t window = axis.objects.position_window;
    const std::int64_t distance = axis.units.to_user(target_) - axis.units.to_user(axis.position());
    const bool inside = window == 0xFFFFFFFF || (distance < 0 ? -distance : distance) <= window;
    target_reached_ = axis.lasts(inside, window_, window == 0xFFFFFFFF ? 0 : axis.objects.position_window_time_ms);
  } else {
    target_reached_ = false;
    window_.reset();
  }
  axis.follow_generator(loop);
}

void ProfilePosition::halt(Axis& axis) {
  braking_ = false;
  if (axis.policy.positioning.halt_discards) {
    count_ = 0;
    immediate_pending_ = false;
    interrupted_ |= running_;
    running_ = false;
  }
}

// 607Dh was changed in motion: the motion ends at the limit or, if that is too near or behind, as early as possible. A
// set-point with immediate effect replaces the motion.
void ProfilePosition::keep_to_limits(Axis& axis) {
  if (immediate_pending_ || !axis.software_limits_active()) return;
  if (!running_) return axis.rest_within_limits();
  const std::int64_t clipped = axis.within_limits_of_turn(target_user_);
  if (clipped == target_user_) return;
  if (axis.policy.limits.target_beyond == OutOfLimits::fault) return axis.raise(Cause::position_limit);
  axis.limited = true;
  target_user_ = clipped;
  const Counts target = axis.units.to_counts(clipped);
  const double velocity = axis.generator.velocity();
  const auto way = static_cast<double>(target - axis.generator.nearest_position());
  const double deceleration = axis.ramp(running_set_point_.deceleration, axis.objects.max_deceleration);
  if (velocity * way >= 0.0 && velocity * velocity <= 2.0 * deceleration * std::abs(way)) {
    return plan(axis, running_set_point_, target, false);
  }
  axis.come_to_rest(RampShape::linear, axis.quick_stop_ramp());
  interrupt(axis, 0);
}

// A motion may cross the software limit although its target lies before it: with an end velocity, or if the set-point
// was given in motion and the axis would have to come back. The axis then brakes as late as possible, by the steeper
// of the motion's ramp and the quick stop's. From rest it continues to its target, or to the next target if it only
// had to pass the first one. A motion with an end velocity ends there instead.
void ProfilePosition::brake_before_limit(Axis& axis) {
  if (!running_ || axis.generator.standing() || !axis.software_limits_active()) return;
  const double own = axis.ramp(running_set_point_.deceleration, axis.objects.max_deceleration);
  const double steepest = std::max(own, axis.quick_stop_ramp());
  const bool passes =
      axis.generator.finished() ? axis.near_software_limit(steepest) : axis.too_fast_for_software_limit(steepest);
  if (!passes) return;
  axis.limited = true;
  axis.come_to_rest(RampShape::linear, steepest);
  const bool goes_on = passing_ ? count_ > 0 : running_set_point_.end_velocity <= 0.0;
  if (!goes_on) return interrupt(axis, 0);
  braking_ = true;
}

// Continues the braking that brake_before_limit() began. Returns true while the axis brakes. A set-point with
// immediate effect ends the braking.
bool ProfilePosition::brakes_before_limit(Axis& axis) {
  if (!braking_) return false;
  if (!immediate_pending_ && !axis.generator.standing()) {
    axis.generator.step(axis.cycle_s);
    target_reached_ = false;
    axis.follow_generator(loop);
    return true;
  }
  braking_ = false;
  if (immediate_pending_) return false;
  if (passing_ && count_ > 0) {
    start(axis, pop(), false);
  } else {
    plan(axis, running_set_point_, target_, false);
  }
  return false;
}

// 607Fh, 6080h, 60C5h or 60C6h was changed in motion: the motion continues within the limits of now. Lower ramps wait
// for the next motion if they would lead beyond the target.
void ProfilePosition::keep_to_profile(Axis& axis) {
  if (!running_) return;
  const double allowed = axis.max_velocity(true);
  const SetPoint motion = running_set_point_;
  const MotionLimits limits = axis.limits(motion.velocity, motion.acceleration, motion.deceleration, motion.jerk);
  const bool ramps = limits.acceleration != planned_.acceleration || limits.deceleration != planned_.deceleration;
  if (allowed == allowed_ && !(ramps && reaches_target(axis, limits))) return;
  allowed_ = allowed;
  planned_ = limits;
  axis.limited = axis.limited || motion.velocity > allowed * (1.0 + 1e-9);
  if (!axis.generator.finished()) return plan(axis, motion, target_, false);
  const double end = std::copysign(std::min(motion.end_velocity, allowed), axis.generator.velocity());
  axis.generator.run_at(end, axis.limits(allowed, motion.acceleration, motion.deceleration, motion.jerk), motion.shape);
}

// Returns true if the motion can still end at its target with the deceleration of `limits`. The distance of a ramp with
// a shape is at most twice that of a linear one.
bool ProfilePosition::reaches_target(const Axis& axis, const MotionLimits& limits) const {
  if (axis.generator.finished() || limits.deceleration >= planned_.deceleration) return true;
  const double velocity = axis.generator.velocity();
  const double end = running_set_point_.end_velocity;
  const double way = static_cast<double>(target_ - axis.generator.nearest_position()) * std::copysign(1.0, velocity);
  const double share = running_set_point_.shape == RampShape::linear ? 1.0 : 2.0;
  return way >= 0.0 && share * (velocity * velocity - end * end) <= 2.0 * limits.deceleration * way;
}

void ProfilePosition::interrupt(Axis&, int) {
  count_ = 0;
  immediate_pending_ = false;
  running_ = false;
  braking_ = false;
  interrupted_ = true;
}

// A set-point whose demand had ended is resumed as well: the halt began at the position of the shaft, before the
// target.
void ProfilePosition::resume(Axis& axis) {
  braking_ = false;
  const bool left = given_ && !interrupted_ && axis.generator.nearest_position() != target_;
  if (!running_ && !left) return;
  axis.limited = false;
  const SetPoint rest = running_set_point_;
  const auto way = static_cast<double>(target_ - axis.generator.nearest_position());
  if (rest.end_velocity <= 0.0 || way * direction_ > 0.0) return plan(axis, rest, target_, false);
  // The halt ended beyond a target that is passed with a velocity: the axis continues with that velocity.
  allowed_ = axis.max_velocity(true);
  axis.generator.run_at(std::copysign(std::min(rest.end_velocity, allowed_), direction_),
                        axis.limits(allowed_, rest.acceleration, rest.deceleration, rest.jerk), rest.shape);
}

std::uint16_t ProfilePosition::status(const Axis& axis) const {
  std::uint16_t bits = 0;
  if (target_reached_) bits |= statusword::target_reached;
  if (acknowledge_ || !room(axis)) bits |= statusword::mode_bit_12;
  if (axis.following_error) bits |= statusword::mode_bit_13;
  return bits;
}

}  // namespace servodrome::drive
