#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "watch_terms.hpp"

// Checks the demand that the drive gives its loops, and its speed.
namespace servodrome::motion {

void Watch::demand() {
  const drive::LoopDemand& now = drive_.axis().demand;
  Demand demand{now.loop, static_cast<double>(now.position) + static_cast<double>(now.position_fraction),
                static_cast<double>(now.velocity)};
  if (now.loop != Loop::position) demand.position = demand_before_.position;
  const bool new_cycle = demand.position != demand_before_.position || demand.velocity != demand_before_.velocity ||
                         demand.loop != demand_before_.loop;
  const Demand before = demand_before_;
  if (!new_cycle) {
    if (tick_ - demand_tick_ > demand_cycle() && now.loop == Loop::position) demand_speed_ = 0.0;
    return;
  }
  demand_before_ = demand;
  // A command between two cycles may change the velocity of the demand at once, but its position only in the next
  // cycle.
  const bool between = demand_tick_ >= 0 && tick_ - demand_tick_ < demand_cycle();
  if (between && now.loop == before.loop && demand.position == before.position) return;
  const std::int64_t passed = demand_tick_ < 0 ? cycle_ticks : std::max(tick_ - demand_tick_, demand_cycle());
  demand_speed_ = now.loop == Loop::position && before.loop == Loop::position && demand_tick_ >= 0
                      ? (demand.position - before.position) / (static_cast<double>(passed) * tick_s)
                      : demand.velocity;
  const std::int64_t cycle = std::min(passed, cycle_ticks);
  demand_tick_ = tick_;
  // A failed encoder, and its position when it works again, shifts a demand that begins at the shaft.
  if (!pwm_ || !had_pwm_ || tick_ - spoiled_ < ms(150)) {
    halted_ = false;  // when the halt ends is not seen
    ramp_ = 0.0;
    return;
  }
  const double seconds = static_cast<double>(cycle) * tick_s;
  // `near`: a demand may be set to the shaft's position plus the lag of the position loop, by a speed that is measured
  // late.
  const double speed = std::abs(velocity_) + overshoot(-1.0);
  const bool caught = tick_ - around_->disturbed < ms(10);  // a locked rotor stands at once, from any speed
  const double near = speed * 4.0 * cycle_ticks * tick_s + lag(speed) + 0.004 * counts_per_revolution_ + 3.0;
  if (demand.loop == Loop::position && before.loop == Loop::position) {
    const double moved = std::abs(demand.position - before.position);
    // The limit is the nameplate's speed, because a demand decreases to a lowered 6080h by its ramps. The previous
    // demand may have been faster, if it began at a faster shaft.
    const double nameplate =
        static_cast<double>(drive_.configuration().motor.max_speed_rpm) / 60.0 * counts_per_revolution_;
    const double most = std::max(nameplate, std::abs(before.velocity)) * 1.02 * seconds + 2.0;
    // A jump by which the demand comes back at least half way to the shaft does not drive the shaft.
    const bool back = std::abs(demand.position - position_) < 0.5 * std::abs(before.position - position_);
    // The demand of a rest without a target follows a shaft that runs past it, and never overtakes the shaft.
    const double ahead = before.position - position_;
    const double left = demand.position - position_;
    const bool follows = stop_.kind != StopKind::none && left * ahead >= 0.0 && std::abs(left) < std::abs(ahead);
    if (moved > most && !caught && !back && !follows && std::abs(demand.position - position_) > near) {
      const bool cyclic = mode_ == Mode::cyclic_sync_position || mode_ == Mode::interpolated_position;
      return fail(cyclic ? "cyclic-demand-jumps" : "demand-jumps",
                  fmt::format("by {:.0f} counts in {:.3f} ms (at most {:.0f}), shaft {:.0f} counts behind, mode {}",
                              moved, 1000.0 * seconds, most, demand.position - position_, static_cast<int>(mode_)));
    }
  }
  if (demand.loop == Loop::position && before.loop == Loop::position)
    first_target(before.velocity, demand.velocity, seconds);
  if (now.loop == Loop::torque && before.loop != Loop::torque) first_torque(now.torque);
  if (!between) after_halt(demand, seconds);  // the loops get the change with the next cycle
  // In profile modes the demand must not accelerate faster than by the steepest ramp.
  const bool profiled = state_ == PowerState::operation_enabled && tick_ - mode_since_ > 2 * cycle_ticks &&
                        tick_ - state_since_ > 2 * cycle_ticks && judgeable_ &&
                        (mode_ == Mode::profile_position || mode_ == Mode::profile_velocity);
  const bool loops = demand.loop == before.loop && (demand.loop == Loop::position || demand.loop == Loop::velocity);
  if (!profiled || !loops) {
    ramp_ = 0.0;
    return;
  }
  if (before.velocity == 0.0 && demand.velocity == 0.0) ramp_ = 0.0;
  const drive::Units& units = drive_.axis().units;
  ramp_ = std::max(ramp_, steepest());
  const bool turns = demand.velocity * before.velocity < 0.0;
  const bool gains = std::abs(demand.velocity) > std::abs(before.velocity) || turns;
  if (!gains) return;
  // From rest the demand may begin with the 6082h of its set-point.
  const double begins_with =
      drive_.policy().positioning.end_velocity_is_start && before.velocity == 0.0 ? end_velocity_given_ : 0.0;
  // Without any ramp to brake, the axis brakes at the current limit, and only the acceleration after that is a ramp.
  const drive::Axis& axis = drive_.axis();
  const bool turns_at_once = turns && axis.profile_deceleration() <= 0.0 && axis.quick_stop_ramp() <= 0.0;
  const double change = std::abs(demand.velocity - (turns_at_once ? 0.0 : before.velocity));
  // Allows for the cycle in which a plan begins, and for the rounding of a float.
  const double allowance = ramp_ * 2.0 * seconds * 1.02 + 1e-4 * greatest_speed() + begins_with;
  // The demand was set to the shaft's speed plus one step of a ramp.
  const bool taken_over =
      std::abs(demand.velocity - velocity_) < 0.05 * std::abs(velocity_) + unsure_speed() + overshoot(-1.0) + allowance;
  const bool smoothed = drive_.configuration().smoothing_ms != 0 || drive_.configuration().position_lag_ms > 0.0F;
  if (change > allowance && !taken_over && !smoothed) {
    return fail(
        "demand-too-steep",
        fmt::format("from {:.1f} to {:.1f} rpm in {:.3f} ms, the ramps allow {:.2f} rpm, mode {}", rpm(before.velocity),
                    rpm(demand.velocity), 1000.0 * seconds, rpm(allowance), static_cast<int>(mode_)));
  }
  double most = greatest_speed();
  if (objects_.max_profile_velocity != 0) most = std::min(most, objects_.max_profile_velocity * units.velocity);
  if (std::abs(demand.velocity) > most * 1.001 + 1e-4 * greatest_speed() && !taken_over &&
      tick_ - around_->commanded > 2 * cycle_ticks && mode_ == Mode::profile_velocity && !ramp_set_.shaped) {
    fail("demand-too-fast", fmt::format("{:.1f} rpm and growing, {:.1f} are allowed", rpm(demand.velocity), rpm(most)));
  }
}

// In profile torque a turning shaft does not begin with a torque beyond its target or against it, such as the torque
// that braked it.
void Watch::first_torque(double torque) {
  if (mode_ != Mode::profile_torque || std::abs(velocity_) < unsure_speed() + overshoot(-1.0)) return;
  const drive::Axis& axis = drive_.axis();
  const bool inverted = axis.units.velocity_inverted != axis.active(drive::Signal::invert_direction);
  const double target = (inverted ? -0.001 : 0.001) * objects_.target_torque;
  constexpr double rounding = 0.001;
  if (torque > std::max(0.0, target) + rounding || torque < std::min(0.0, target) - rounding) {
    fail("torque-begins-wrong", fmt::format("with {:.3f} of rated torque at {:.0f} rpm, the target is {:.3f}", torque,
                                            rpm(velocity_), target));
  }
}

// Counts the targets since the demand of a cyclic mode last began: with the mode, with power, or after a halt. The
// first target may be far away.
void Watch::count_targets() {
  const bool cyclic = mode_ == Mode::cyclic_sync_position || mode_ == Mode::interpolated_position;
  if (!cyclic) {  // a new mode restarts the count
    targets_ = 0;
    return;
  }
  const drive::Configuration::PositionChange& step = drive_.configuration().position_change;
  const std::uint64_t target =
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.target_position)) << 32 ^
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.position_offset)) * 5 ^
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.interpolation_data_record)) * 3 ^
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.min_position_limit)) *
          7 ^  // targets are clipped to these limits
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.max_position_limit)) * 11 ^
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(step.least)) *
          13 ^  // and to the greatest step from the last target
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(step.greatest)) * 17;
  if (state_ != PowerState::operation_enabled || !pwm_ || stop_.kind != StopKind::none || mode_since_ == tick_) {
    targets_ = 0;
  } else if (target != cyclic_target_) {
    ++targets_;
  }
  cyclic_target_ = target;
}

void Watch::first_target(double from, double to, double seconds) {
  const bool cyclic = mode_ == Mode::cyclic_sync_position || mode_ == Mode::interpolated_position;
  const std::uint16_t word = drive_.axis().controlword;
  const bool runs = state_ == PowerState::operation_enabled && (word & controlword::halt) == 0 &&
                    drive::command_of(word) == drive::Command::enable_operation && stop_.kind == StopKind::none;
  if (!cyclic || !runs || targets_ > 0 || !judgeable_) return;
  constexpr double jump_share = 0.13;
  const double greatest =
      static_cast<double>(drive_.configuration().motor.max_speed_rpm) / 60.0 * counts_per_revolution_;
  // Compared with the demand before, or with the shaft from which a mode begins.
  const double gained = std::abs(to) - std::max(std::abs(from), std::abs(velocity_));
  const drive::MotionLimits limits = drive_.axis().catch_up_limits();
  const double most =
      // A mode that begins between two cycles makes its first step at once.
      std::max(jump_share * greatest, 2.2 * std::max(limits.acceleration, limits.deceleration) * seconds);
  if (gained > most && objects_.velocity_offset == 0) {
    fail("first-target-jumps", fmt::format("from {:.0f} to {:.0f} rpm in {:.3f} ms, mode {}", rpm(from), rpm(to),
                                           1000.0 * seconds, static_cast<int>(mode_)));
  }
}

// Checks the first demand after a halt, which may have ended anywhere on its ramp.
void Watch::after_halt(const Demand& demand, double seconds) {
  const std::uint16_t word = drive_.axis().controlword;
  const bool runs = state_ == PowerState::operation_enabled && state_ == before_ && mode_since_ != tick_ &&
                    drive::command_of(word) == drive::Command::enable_operation &&
                    (mode_ == Mode::profile_position || mode_ == Mode::profile_velocity);
  const bool halt =
      (word & controlword::halt) != 0 && (drive_.policy().modes.without_halt & drive::mode_bit(mode_)) == 0;
  const bool ended = std::exchange(halted_, runs && halt) && runs && !halt;
  const drive::Axis& axis = drive_.axis();
  const bool held =
      // a limit stops the axis with a separate ramp
      axis.at_limit_switch() || (axis.limited && axis.software_limits_active());
  if (!ended || held || !judgeable_ || acceleration_ <= 0.0) return;
  // The drive's speed is a cycle old, and a shaft that follows its demand does so within 5 %.
  const double off = std::abs(demand.velocity - velocity_);
  const double most = 0.06 * std::abs(velocity_) + 2.0 * still_rpm / 60.0 * counts_per_revolution_ + overshoot(-1.0) +
                      2.0 * std::max(steepest_given_, ramp_) * seconds;
  if (off > most && end_velocity_given_ == 0.0) {
    fail("halt-ends-with-a-jump", fmt::format("{:.0f} rpm are demanded at {:.0f} rpm, mode {}", rpm(demand.velocity),
                                              rpm(velocity_), static_cast<int>(mode_)));
  }
}

void Watch::speed_limits() {
  const drive::LoopDemand& now = drive_.axis().demand;
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && judgeable_ &&
                      (now.loop == Loop::position || now.loop == Loop::velocity) && mode_ != Mode::homing &&
                      mode_ != Mode::velocity && !drive_.identification().running();
  if (!judged) {
    excess_.most = -1.0;
    return;
  }
  double most = greatest_speed();
  if (mode_ == Mode::profile_velocity && objects_.max_profile_velocity != 0)
    most = std::min(most, objects_.max_profile_velocity * drive_.axis().units.velocity);
  if (at_once_.active && at_once_.taken) most = std::min(most, at_once_.speed);
  const double speed = std::abs(now.loop == Loop::position ? demand_speed_ : static_cast<double>(now.velocity));
  const double over = speed - most;
  const bool within = over <= 0.02 * most + 0.002 * greatest_speed();
  if (within || !excess_.begun || most != excess_.most) {
    // A demand that begins at the shaft comes down from the speed that the drive measures.
    const double shaft = std::abs(velocity_) - most;
    const double measured = most != excess_.most ? over : std::min(over, shaft + unsure_speed());
    excess_ = {tick_, most, std::max({measured, shaft, 0.0}), drive_.axis().generator.acceleration(), 0.0, !within};
    return;
  }
  // If the motor has too little torque for the ramp, the demand follows the shaft. The torque then determines the
  // time, and without torque there is no limit for it.
  const double ramp = slope() > 0.0 ? std::min(slope(), acceleration_) : acceleration_;
  if (ramp <= 0.0) return;
  const drive::Configuration& own = drive_.configuration();
  // A sin2 or jerk-free ramp is one piece. One that leads to rest begins more gently than one that ends at the limit:
  // its first part grows at most with the third power of time.
  const bool one_piece = objects_.motion_profile_type == 1 || objects_.motion_profile_type == 2;
  const double fastest = excess_.most + excess_.over;
  const double gentle = one_piece ? 2.0 * fastest / ramp * 1.15 * std::cbrt(0.1 * excess_.over / fastest) : 0.0;
  const double fall = std::max({excess_.over / ramp + jerk_delay(excess_.over, ramp, excess_.gaining),
                                one_piece ? 2.0 * excess_.over / ramp : 0.0, gentle});
  const double enough =
      1.1 * fall + lag_s + 0.001 * own.smoothing_ms + 0.003 * static_cast<double>(own.position_lag_ms);
  excess_.done += tick_s / enough;  // ramps and torque may change meanwhile
  if (excess_.done > 1.0) {
    fail("limit-not-obeyed",
         fmt::format(
             "{:.0f} rpm are demanded since {:.3f} s, {:.0f} are allowed, {:.3f} s are enough to come down, mode {}",
             rpm(speed), static_cast<double>(tick_ - excess_.since) * tick_s, rpm(most), enough,
             static_cast<int>(mode_)));
  }
}

}  // namespace servodrome::motion
