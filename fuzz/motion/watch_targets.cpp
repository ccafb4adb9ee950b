#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <utility>

#include "watch_terms.hpp"

// Checks that set-points and cyclic targets are reached, and that an axis does not move without a command.
namespace servodrome::motion {

// Checks a single set-point of profile position, from the edge of bit 4 to rest.
void Watch::set_points() {
  const std::uint16_t word = objects_.controlword;
  const bool edge = (word & controlword::mode_bit_4) != 0 && (word_before_ & controlword::mode_bit_4) == 0;
  const bool working = state_ == PowerState::operation_enabled && mode_ == Mode::profile_position && pwm_ &&
                       (word & (controlword::halt | controlword::fault_reset)) == 0 && judgeable_ &&
                       // any other command cancels the set-point
                       drive::command_of(word) == drive::Command::enable_operation;
  const std::uint16_t word_before = std::exchange(word_before_, word);
  const bool reached_before =
      std::exchange(reached_, (objects_.statusword & drive::statusword::target_reached) != 0 && shown_bits_.reached);
  const bool ready_before = std::exchange(ready_, (objects_.statusword & drive::statusword::mode_bit_12) == 0);
  const std::uint32_t velocity_before = std::exchange(profile_velocity_before_, objects_.profile_velocity);
  if (!working) {
    at_once_.active = set_point_.active = set_point_.leaves = false;
    set_point_.alone = tick_;
    return;
  }
  const drive::Axis& axis = drive_.axis();
  const bool changed = objects_.target_position != target_before_;
  target_before_ = objects_.target_position;
  const bool at_switch = axis.at_limit_switch();
  const bool bounded =
      axis.software_limits_active() && drive_.policy().limits.target_beyond != drive::OutOfLimits::fault;
  const bool limited = at_switch || (axis.software_limits_active() && !bounded);
  // The stop at a limit switch ends with the shaft's rest. Until then an earlier set-point waits, and if that one leads
  // into the limit, the stop discards the later ones.
  if (at_switch && std::abs(velocity_) > still_rpm * counts_per_s_per_rpm_) set_point_.alone = tick_;
  if (edge) {
    // Its 6081h may be the present one or that of the previous tick.
    const double asked = std::max(velocity_before, objects_.profile_velocity) * axis.units.velocity;
    const bool at_once = (word & controlword::mode_bit_5) != 0 && ready_before;
    at_once_ = {at_once && !drive_.policy().positioning.end_velocity_is_start, false, tick_, asked};
    const bool relative = (word & controlword::mode_bit_6) != 0;
    // Other bits of 60F2h (2 to 5) change when the motion begins. 6082h is the speed at its beginning in some
    // products, at its target in others.
    constexpr int plain_options = 0xC3;
    const bool passes = objects_.end_velocity != 0 && !drive_.policy().positioning.end_velocity_is_start;
    const bool usual = (word & controlword::mode_bit_9) == 0 &&
                       (objects_.positioning_option_code & ~plain_options) == 0 && objects_.profile_velocity != 0 &&
                       objects_.profile_acceleration != 0 && objects_.profile_deceleration != 0 &&
                       tick_ - frame_since_ > 2 * cycle_ticks;
    const bool standing = ready_before && tick_ - set_point_.alone > ms(30) && !drive_.in_motion() &&
                          axis.demand.loop == Loop::position &&
                          std::abs(velocity_) < still_rpm / 60.0 * counts_per_revolution_;
    const double target = static_cast<double>(axis.units.to_counts(objects_.target_position));
    // A relative set-point counts from the previous target, so the axis must have reached that one.
    const bool based = !relative || (reached_before && (word_before & controlword::halt) == 0);
    set_point_.active = usual && standing && based && !limited && !changed && acceleration_ > 0.0;
    set_point_.taken = false;
    set_point_.reached = 0;
    // The set-point leads away from the one limit switch that is active.
    const bool below = axis.active(drive::Signal::negative_limit);
    const bool above = axis.active(drive::Signal::positive_limit);
    const double least = 0.3 * counts_per_revolution_;
    set_point_.leaves = usual && standing && relative && !changed && below != above && !axis.software_limits_active() &&
                        (drive_.policy().limits.switches == drive::LimitSwitches::stop) && acceleration_ > 0.0 &&
                        (below ? target > least : target < -least);
    set_point_.from = position_;
    set_point_.direction = below ? 1.0 : -1.0;
    set_point_.since = tick_;
    resolve(relative, bounded);
    set_point_.passes = passes;
    if (passes && bounded) set_point_.active = false;  // a motion ends at a software limit
    set_point_.alone = tick_;
    const double way = std::max(std::abs(set_point_.target - position_), set_point_.range);
    double speed = objects_.profile_velocity * axis.units.velocity;
    if (objects_.max_profile_velocity != 0)
      speed = std::min(speed, objects_.max_profile_velocity * axis.units.velocity);
    speed = std::min(speed, greatest_speed());
    set_point_.speed = std::max(speed, 1.0);
    const Stopping stopping = this->stopping(speed);
    set_point_.seconds = way / speed + 4.0 * stopping.seconds + 0.3;
    if (way > 1000.0 * counts_per_revolution_) set_point_.active = false;
    return;
  }
  if (at_once_.active) {  // until another command
    if ((objects_.statusword & drive::statusword::mode_bit_12) != 0) at_once_.taken = true;
    if (around_->commanded > at_once_.since + ms(10)) at_once_.active = false;
  }
  if (set_point_.leaves) {
    if ((objects_.statusword & drive::statusword::mode_bit_12) != 0) set_point_.taken = true;
    const double moved = set_point_.direction * (position_ - set_point_.from);
    const bool again = around_->commanded > set_point_.since + ms(10);
    if (again || moved > 0.1 * counts_per_revolution_ || (!set_point_.taken && tick_ - set_point_.since > ms(10)) ||
        axis.active(set_point_.direction > 0.0 ? drive::Signal::positive_limit : drive::Signal::negative_limit)) {
      set_point_.leaves = false;
    } else if (const double acceleration = std::min(slope(), acceleration_);
               static_cast<double>(tick_ - set_point_.since) * tick_s >
               0.2 + std::sqrt(0.5 * counts_per_revolution_ / std::max(acceleration, 1.0)) +
                   0.3 * counts_per_revolution_ / set_point_.speed + 0.001 * drive_.configuration().brake_release_ms) {
      fail("no-way-off-limit",
           fmt::format("{:.2f} revolutions away {:.0f} ms after the set-point", moved / counts_per_revolution_,
                       static_cast<double>(tick_ - set_point_.since) / ticks_per_ms));
    }
  }
  if (!set_point_.active) {
    if (drive_.in_motion()) set_point_.alone = tick_;
    return;
  }
  // Any other write may change the plan, and of two controlwords the first may have stopped the axis. A limit that is
  // written with the set-point may come by a later frame.
  if (limited || two_words() || set_point_.limits != set_point_limits() ||
      around_->commanded > set_point_.since + ms(10)) {
    set_point_.active = false;
    set_point_.alone = tick_;
    return;
  }
  if ((objects_.statusword & drive::statusword::mode_bit_12) != 0) set_point_.taken = true;
  if (!set_point_.taken) {  // not acknowledged
    if (tick_ - set_point_.since > ms(10)) set_point_.active = false;
    return;
  }
  const double seconds = static_cast<double>(tick_ - set_point_.since) * tick_s;
  const bool reached = (objects_.statusword & drive::statusword::target_reached) != 0 && !drive_.in_motion();
  double beside = std::abs(position_ - set_point_.target);
  if (set_point_.range > 0.0) beside = std::abs(std::remainder(position_ - set_point_.target, set_point_.range));
  const double went = (position_ - set_point_.from) * (axis.units.position_inverted ? -1.0 : 1.0);
  constexpr double unsure_revolutions = 0.2;  // for the place of the demand, and for the swing of a soft loop
  const double most = 0.5 * set_point_.range + unsure_revolutions * counts_per_revolution_;
  const double back = unsure_revolutions * counts_per_revolution_;
  if ((set_point_.side == 1 && went > back) || (set_point_.side == 2 && went < -back) ||
      (set_point_.side == 3 && std::abs(went) > most)) {
    set_point_.active = false;
    return fail("range-way-is-untrue",
                fmt::format("{:.2f} revolutions, 60F2h is {:02X}h, the range has {:.2f}", went / counts_per_revolution_,
                            objects_.positioning_option_code, set_point_.range / counts_per_revolution_));
  }
  if (set_point_.passes) {  // it continues beyond its target
    const double way = set_point_.target - set_point_.from;
    const bool there =
        (position_ - set_point_.target) * way >= 0.0 || beside < place_revolutions * counts_per_revolution_;
    if (there) set_point_.active = false;
    if (there || seconds <= set_point_.seconds) return;
  }
  // A motor with too little torque for its ramps arrives later than its demand.
  const bool rests = std::abs(velocity_) < still_rpm * counts_per_s_per_rpm_;
  set_point_.reached = reached && rests ? set_point_.reached + 1 : 0;
  if (set_point_.reached > ms(80) || seconds > set_point_.seconds) {
    set_point_.active = false;
    const bool arrived = beside < 2.0 * place_revolutions * counts_per_revolution_;
    if (!arrived) {
      fail(set_point_.reached > ms(80) ? "target-missed" : "never-arrives",
           fmt::format("{:.2f} revolutions beside the target {:.3f} s after the set-point, at {:.0f} rpm",
                       beside / counts_per_revolution_, seconds, rpm(velocity_)));
    } else if (!reached &&
               beside + 1.0 < static_cast<double>(axis.units.to_counts(std::min<std::int64_t>(
                                  objects_.position_window, std::numeric_limits<std::int32_t>::max()))) &&
               objects_.position_window_time_ms < 50 && std::abs(velocity_) < 2.0 / 60.0 * counts_per_revolution_) {
      fail("reached-is-missing",
           fmt::format("no bit 10 {:.3f} s after the set-point, {:.0f} counts beside the target", seconds, beside));
    }
  }
}

// Computes the target of a set-point that is given to an axis at rest.
void Watch::resolve(bool relative, bool bounded) {
  const drive::Axis& axis = drive_.axis();
  const std::int64_t demand = axis.demand.position + drive_.position_offset();
  const std::int64_t turn = axis.turn_of_demand();
  std::int64_t asked = objects_.target_position;
  set_point_.side = 0;
  set_point_.range = 0.0;
  set_point_.limits = set_point_limits();
  if (const std::int64_t range = axis.position_range(); range != 0 && !relative) {
    const std::int64_t within = (asked - objects_.min_position_range_limit) % range;  // wraps around at the ends
    asked = objects_.min_position_range_limit + (within < 0 ? within + range : within);
    const bool bound = axis.limits_bound_range();  // the other direction is forbidden
    if (!bound) set_point_.side = objects_.positioning_option_code >> 6 & 3;
    if (set_point_.side != 0) set_point_.range = static_cast<double>(range) * axis.units.position.value();
  }
  std::int64_t user = turn + asked;
  if (relative) {
    const bool to_actual = (objects_.positioning_option_code & 3) == 2;
    user = asked + axis.units.to_user(to_actual ? std::llround(position_) + drive_.position_offset() : demand);
  }
  if (bounded)
    user = turn + std::clamp<std::int64_t>(user - turn, objects_.min_position_limit, objects_.max_position_limit);
  set_point_.target = static_cast<double>(axis.units.to_counts(user) - drive_.position_offset());
}

// Checks that the axis follows a cyclic target that leads away from the one active limit switch and came while it was
// active.
void Watch::off_limit() {
  if (mode_ != Mode::cyclic_sync_position) {
    held_by_ = 0;
    away_ = {};
    return;
  }
  const drive::Axis& axis = drive_.axis();
  const bool below = axis.active(drive::Signal::negative_limit);
  const bool above = axis.active(drive::Signal::positive_limit);
  // A switch holds the axis until the axis is commanded away from it, even if the switch has opened and the other one
  // is active.
  const double still = still_rpm / 60.0 * counts_per_revolution_;
  const auto led = static_cast<double>(axis.demand.velocity);
  if (state_ != PowerState::operation_enabled || mode_since_ == tick_) held_by_ = 0;
  if (led > 0.0 && velocity_ > still) held_by_ &= ~1u;
  if (led < 0.0 && velocity_ < -still) held_by_ &= ~2u;
  held_by_ |= (below ? 1u : 0u) | (above ? 2u : 0u);
  if (below == above || held_by_ == 3) {
    away_ = {};
    return;
  }
  const double slowest_rpm = 4.0 * still_rpm;
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && judgeable_ && acceleration_ > 0.0 &&
                      stop_.kind == StopKind::none && drive_.policy().limits.switches == drive::LimitSwitches::stop &&
                      !axis.software_limits_active() && tick_ - frame_since_ > 2 * cycle_ticks &&
                      (axis.controlword & controlword::halt) == 0 &&
                      objects_.min_position_range_limit == objects_.max_position_range_limit &&
                      !drive_.configuration().position_change.limited &&  // may allow no step away from the switch
                      rpm(greatest_speed()) > slowest_rpm && mode_since_ != tick_;
  const double direction = below ? 1.0 : -1.0;
  const double target = nearest_place_of(std::int64_t{objects_.target_position} + objects_.position_offset);
  if (!judged || std::exchange(away_.target, target) != target) {
    away_.targets = judged ? away_.targets + 1 : 0;
    away_.since = tick_;
    away_.from = position_;
    return;
  }
  constexpr double least_revolutions = 0.3;
  if (direction * velocity_ < -still_rpm / 60.0 * counts_per_revolution_) {  // it still brakes before the switch
    away_.since = tick_;
    away_.from = position_;
  }
  const double moved = direction * (position_ - away_.from);
  if (direction * (target - away_.from) < least_revolutions * counts_per_revolution_ || away_.targets < 3) return;
  if (std::abs(target - away_.from) > 0x40000000) return;  // the product chooses the direction of such a distance
  const double ramp = slope() > 0.0 ? std::min(slope(), acceleration_) : acceleration_;
  const double passed = static_cast<double>(tick_ - away_.since) * tick_s;
  const double period = objects_.interpolation_time_period_value * std::pow(10.0, objects_.interpolation_time_index);
  if (passed > 0.2 + period + std::sqrt(0.5 * counts_per_revolution_ / ramp) && moved < 0.05 * counts_per_revolution_) {
    fail("no-way-off-limit",
         fmt::format("{:.2f} revolutions away {:.0f} ms after a target {:.2f} revolutions away, mode {}",
                     moved / counts_per_revolution_, 1000.0 * passed,
                     direction * (target - away_.from) / counts_per_revolution_, static_cast<int>(mode_)));
  }
}

// A demand that catches up with its targets must not go beyond them. The drive bridges one missing target.
void Watch::beyond_targets() {
  if (mode_ != Mode::cyclic_sync_position) {
    given_.active = false;
    return;
  }
  const drive::Axis& axis = drive_.axis();
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && judgeable_ && acceleration_ > 0.0 &&
                      axis.demand.loop == Loop::position && objects_.velocity_offset == 0 &&
                      objects_.min_position_range_limit == objects_.max_position_range_limit;
  constexpr std::uint16_t halts = controlword::halt | controlword::fault_reset;  // halt also acts together with bit 7
  const bool stops = stop_.kind != StopKind::none || (objects_.controlword & halts) == halts ||
                     axis.active(drive::Signal::negative_limit) || axis.active(drive::Signal::positive_limit) ||
                     axis.software_limits_active();
  const auto place = static_cast<double>(axis.demand.position);
  const double target = nearest_place_of(std::int64_t{objects_.target_position} + objects_.position_offset);
  const bool begins =
      !given_.active || stops || tick_ - std::max({mode_since_, state_since_, frame_since_}) < 2 * cycle_ticks;
  // A target that software limits clip stays clipped when they are switched off, until the next one.
  if (axis.software_limits_active()) {
    const drive::Axis::UserLimits limits = axis.software_limits();
    const std::int64_t user = std::int64_t{objects_.target_position} + objects_.position_offset;
    clipped_target_ = nearest_place_of(std::clamp(user, limits.least, limits.greatest));
  } else if (!given_.active || target != given_.newest) {
    clipped_target_ = target;
  }
  constexpr double half_way_round = 0x40000000;  // beyond this distance the product chooses the direction
  if (begins) given_.round = false;
  given_.round |= std::abs(target - place) > half_way_round;
  if (!judged || given_.round) {
    given_.active = judged;
    return;
  }
  const double speed = std::max(std::abs(velocity_), std::abs(static_cast<double>(axis.demand.velocity)));
  const double step = target - given_.newest;
  const double ramp = axis.profile_deceleration();
  const bool turns = step * static_cast<double>(axis.demand.velocity) < 0.0;
  if (begins) {
    given_ = {.active = true,
              .low = std::min({place, target, clipped_target_}),
              .high = std::max({place, target, clipped_target_}),
              .newest = target,
              .slope = ramp};
  }
  const bool gentler = ramp > 0.0 && (given_.slope <= 0.0 || ramp < given_.slope);  // 0: the current limit
  if (begins || turns || gentler) {
    // The demand may begin at the shaft, and brakes by the present ramp.
    const double way = ramp_way(speed, slope()) + lag(speed) + place_revolutions * counts_per_revolution_;
    given_.low = std::min({given_.low, place - way, position_ - way});
    given_.high = std::max({given_.high, place + way, position_ + way});
  }
  given_.slope = ramp;
  if (step != 0.0) {
    // A missing target is bridged for one period, after a tolerance of one or two cycles. A target that is written
    // between two others causes a separate speed.
    const double period = objects_.interpolation_time_period_value * std::pow(10.0, objects_.interpolation_time_index);
    const double bridge = std::max(2.0 * std::abs(step), speed * (1.1 * period + 0.002));
    given_.low = std::min(given_.low, target - bridge);
    given_.high = std::max(given_.high, target + bridge);
    given_.newest = target;
  }
  const double beyond = std::max(given_.low - place, place - given_.high);
  if (beyond > place_revolutions * counts_per_revolution_) {
    fail("demand-beyond-targets", fmt::format("by {:.2f} revolutions, at {:.0f} rpm", beyond / counts_per_revolution_,
                                              rpm(static_cast<double>(axis.demand.velocity))));
  }
}

void Watch::unasked() {
  // The axis may wait for targets that come towards it, which takes as long as the master needs.
  constexpr std::uint16_t follows = drive::statusword::mode_bit_12 | drive::statusword::internal_limit_active;
  const std::uint16_t axis_word = drive_.axis().controlword;
  const bool awaits_line = mode_ == Mode::cyclic_sync_position && (objects_.statusword & follows) == 0;
  // Homing and interpolation move the axis only with bit 4.
  const bool started = (mode_ == Mode::homing || mode_ == Mode::interpolated_position) &&
                       (((axis_word | objects_.controlword) & controlword::mode_bit_4) != 0 || drive_.homes());
  const bool open = started || mode_ == Mode::profile_torque || mode_ == Mode::cyclic_sync_torque ||
                    (mode_ == Mode::cyclic_sync_velocity && objects_.target_velocity + objects_.velocity_offset != 0) ||
                    drive_.identification().running() || awaits_line;
  if (!judgeable_ || !pwm_ || open || state_ != PowerState::operation_enabled ||
      tick_ - std::max(pwm_since_, mode_since_) < ms(50)) {
    rest_ = position_;
    rest_since_ = tick_;
    return;
  }
  const double away = std::abs(position_ - rest_);
  const bool moves = away > 0.004 * counts_per_revolution_ + 3.0 || drive_.in_motion();
  const std::int64_t rested = tick_ - rest_since_;
  const std::int64_t enough = ms(120.0 + drive_.configuration().brake_release_ms);
  if (rested < enough) {
    if (moves) {
      rest_ = position_;
      rest_since_ = tick_;
    }
    return;
  }
  if (away > 0.15 * counts_per_revolution_) {
    if (std::max(around_->commanded, asked_) < rest_since_ && around_->disturbed < rest_since_) {
      fail("moves-unasked",
           fmt::format("{:.2f} revolutions from where it rested {:.1f} ms, mode {}", away / counts_per_revolution_,
                       static_cast<double>(rested) / ticks_per_ms, static_cast<int>(mode_)));
    }
    rest_ = position_;
    rest_since_ = tick_;
  }
  if (std::max(around_->commanded, asked_) >= rest_since_) {  // there was a command
    rest_ = position_;
    rest_since_ = tick_;
  }
}

}  // namespace servodrome::motion
