#include <array>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "watch_terms.hpp"

// Checks stops, limit switches and software limits: how far the shaft may still move.
namespace servodrome::motion {

void Watch::stops() {
  StopKind kind = StopKind::none;
  const drive::Command command = drive::command_of(objects_.controlword);
  // A set-point that is given while the DC link charges takes effect with Operation enabled.
  const bool operates = state_ == PowerState::operation_enabled;
  if (two_words()) two_words_at_ = tick_;
  const drive::Generator& generator = drive_.axis().generator;
  const bool lately_two_words = tick_ - two_words_at_ <= cycle_ticks;
  const bool speeds_up = operates && generator.acceleration() * generator.velocity() > 0.0;
  if (mode_ != Mode::profile_position || mode_since_ == tick_ ||
      (!operates && before_ == PowerState::operation_enabled)) {
    has_target_ = false;
  } else if ((objects_.controlword & controlword::mode_bit_4) != 0 || (lately_two_words && speeds_up) ||
             (operates && (objects_.statusword & drive::statusword::mode_bit_12) != 0)) {
    has_target_ = true;
  }
  const bool resets = (objects_.controlword & controlword::fault_reset) != 0;
  const bool halt = (objects_.controlword & controlword::halt) != 0 &&
                    (drive_.policy().modes.without_halt & drive::mode_bit(mode_)) == 0 && mode_ != Mode::none;
  if (state_ == PowerState::quick_stop_active) {
    kind = StopKind::quick;
  } else if (state_ == PowerState::fault_reaction_active) {
    kind = StopKind::fault;
  } else if (state_ == PowerState::operation_enabled && !resets) {
    if (command != drive::Command::enable_operation) {
      kind = StopKind::leave;
    } else if (halt) {
      kind = StopKind::halt;
    } else if (mode_ == Mode::profile_velocity && objects_.target_velocity == 0) {
      kind = StopKind::velocity;
    } else if (mode_ == Mode::velocity && commands_no_velocity()) {
      kind = StopKind::velocity;
    } else if (mode_ == Mode::profile_position && !has_target_) {
      kind = StopKind::no_target;
    } else if (mode_ == Mode::none) {
      kind = StopKind::no_mode;
    } else if (mode_ == Mode::homing && (drive_.axis().controlword & controlword::mode_bit_4) == 0) {
      kind = StopKind::homing;
    }
  }
  if (!pwm_ || (around_->injected & spoils_motion) != 0 || around_->locked) kind = StopKind::none;
  if (kind == StopKind::none && stop_.kind == StopKind::none) return;
  // Ticks since the stop began or was last disturbed, for the message.
  const std::int64_t settled = tick_ - std::max({stop_.since, around_->disturbed, mode_since_});
  if (kind != stop_.kind || around_->disturbed > stop_.since || mode_since_ > stop_.since || !judgeable_) {
    if (kind == StopKind::none) {
      stop_ = {};
      return;
    }
    // A stop that continues in another mode keeps the ramp with which it began.
    const bool goes_on = kind == stop_.kind && stop_.slope > 0.0 && slope() > 0.0;
    const double gentlest = goes_on ? std::min(slope(), stop_.slope) : slope();
    // A shaft that lags behind the ramp of a stop that continues may become as fast again as at its beginning. A new
    // stop begins with the speed that the drive's filter shows, a little late.
    double speed = goes_on ? std::max(std::abs(velocity_), stop_.speed) : std::max(fastest_[0], fastest_[1]);
    // Homing that is aborted continues a ramp to rest that already runs; the shaft may swing about its demand.
    const bool brakes = generator.acceleration() * generator.velocity() < 0.0;
    const double off = std::abs(position_ - static_cast<double>(drive_.axis().demand.position));
    if (kind == StopKind::homing && brakes && off < swing_revolutions * counts_per_revolution_)
      speed = std::max(speed, std::abs(generator.velocity()));
    const Stopping stopping = this->stopping(speed, gentlest);
    // The measured speed is late, and a swinging shaft may have reversed meanwhile.
    const double unsure = 4.0 * still_rpm * counts_per_s_per_rpm_ + overshoot(-1.0);
    // The shaft may have rebounded from a hard stop towards which the demand still leads.
    const bool thrown_back = kind == stop_.kind && static_cast<double>(drive_.axis().demand.velocity) * velocity_ < 0.0;
    const bool turns = std::abs(velocity_) > unsure && !swings_about_rest() && !thrown_back;
    const double direction = turns ? std::copysign(1.0, velocity_) : 0.0;
    const std::int64_t began = kind == stop_.kind ? stop_.began : tick_;
    stop_ = {kind,
             began,
             tick_,
             position_,
             stopping.counts,
             stopping.seconds,
             gentlest,
             speed,
             direction,
             direction * position_,
             ramp_set_.shaped};
    return;
  }
  if (kind == StopKind::none) return;
  if (acceleration_ <= 0.0) {  // without torque it cannot brake: judge it from here on
    stop_.since = tick_;
    stop_.from = position_;
  }
  const bool shaped = stop_.shaped || ramp_set_.shaped;
  if (const double ramp = slope(); ramp != stop_.slope || shaped != stop_.shaped) {
    // The ramp was written during the stop, which may have been planned with the old one or the new one.
    const double gentler = ramp > 0.0 && stop_.slope > 0.0 ? std::min(ramp, stop_.slope) : std::max(ramp, stop_.slope);
    if (gentler != stop_.slope || shaped != stop_.shaped) {
      const Stopping stopping = this->stopping(velocity_, gentler);
      stop_ = {kind,    stop_.began, tick_,           position_,      stopping.counts, stopping.seconds,
               gentler, stop_.speed, stop_.direction, stop_.furthest, shaped};
      return;
    }
  }
  const double place = stop_.direction * position_;
  stop_.furthest = std::max(stop_.furthest, place);
  static constexpr std::array names{"none",           "halt",      "leaving operation", "quick stop",
                                    "fault reaction", "60FFh = 0", "homing given up",   "no set-point",
                                    "no mode"};
  const char* name = names[static_cast<std::size_t>(kind)];
  const double way = std::abs(position_ - stop_.from);
  constexpr double rounding = 1.005;  // for distances of many revolutions
  if (way > rounding * stop_.counts) {
    return fail("stop-runs-away",
                fmt::format("{}: {:.2f} revolutions after {:.1f} ms, at {:.0f} rpm; {:.2f} are enough for it", name,
                            way / counts_per_revolution_, static_cast<double>(settled) / ticks_per_ms, rpm(velocity_),
                            stop_.counts / counts_per_revolution_));
  }
  // While the brake opens it holds the axis. A shaft that swings about its place of rest goes back in each swing.
  const bool held = stop_.since - pwm_since_ <= ms(drive_.configuration().brake_release_ms);
  if (kind != StopKind::velocity && !held && acceleration_ > 0.0 && drive_.axis().demand.loop == Loop::position &&
      !swings_about_rest() && stop_.furthest - place > swing_revolutions * counts_per_revolution_ + 0.1 * way) {
    return fail("stop-goes-back", fmt::format("{}: {:.2f} revolutions back, at {:.0f} rpm", name,
                                              (stop_.furthest - place) / counts_per_revolution_, rpm(velocity_)));
  }
  const double late = static_cast<double>(tick_ - stop_.since) * tick_s - stop_.seconds;
  const bool swings = swings_about_rest() || (kind > StopKind::velocity && drive_.axis().demand.velocity == 0.0F);
  if (late > 0.3 && !swings && std::abs(velocity_) > 2.0 * still_rpm / 60.0 * counts_per_revolution_) {
    const char* broken = kind == StopKind::velocity ? "velocity-not-obeyed" : "stop-never-ends";
    fail(broken, fmt::format("{}: still {:.0f} rpm after {:.3f} s; {:.3f} s are enough for it", name, rpm(velocity_),
                             static_cast<double>(tick_ - stop_.since) * tick_s, stop_.seconds));
  }
  if (late > 2.0 && kind == StopKind::fault) fail("stop-never-ends", "fault reaction active does not end");
}

// Returns true if vl velocity mode commands velocity 0: by bits 4 to 6 of the controlword, or by 6042h = 0. A locked
// ramp keeps its velocity.
bool Watch::commands_no_velocity() const {
  const std::uint16_t word = drive_.axis().controlword;
  if ((word & controlword::mode_bit_4) == 0) return true;
  if ((word & controlword::mode_bit_5) == 0) return false;
  return (word & controlword::mode_bit_6) == 0 || objects_.vl_target_velocity == 0;
}

// Returns true if the shaft swings about a demand that stands. With a soft loop that may last long.
bool Watch::swings_about_rest() const {
  const drive::LoopDemand& demand = drive_.axis().demand;
  return demand.loop == Loop::position && demand.velocity == 0.0F &&
         std::abs(position_ - static_cast<double>(demand.position)) < swing_revolutions * counts_per_revolution_;
}

void Watch::limit_switches() {
  if (drive_.policy().limits.switches != drive::LimitSwitches::stop) return;
  const std::uint32_t inputs = axis_.feedback().inputs;
  const bool any = (inputs & (negative_wire_ | positive_wire_)) != 0;
  const bool moves = drive_.axis().demand.velocity != 0.0F;
  if (!any && !moves) {
    limits_ = {};
    return;
  }
  for (std::size_t i = 0; i < 2; ++i) {
    const double direction = i == 0 ? -1.0 : 1.0;
    const bool closed = (inputs & (i == 0 ? negative_wire_ : positive_wire_)) != 0;
    const bool signal = drive_.axis().active(i == 0 ? drive::Signal::negative_limit : drive::Signal::positive_limit);
    // In torque control the switch limits the speed. A load may still move the axis until the loop's integral has
    // built up.
    const bool loaded = drive_.axis().demand.loop == Loop::torque && around_->load_share != 0.0;
    const bool active = closed && signal && pwm_ && has_stage(state_) && !drive_.homes() && !loaded;
    Limit& limit = limits_[i];
    if (!active) {  // after a bounce of the switch a stop continues with its ramp
      limit = {.slope = moves ? limit.slope : 0.0};
      continue;
    }
    // In the position loop the shaft comes to the place of the demand, even if it has swung back from there.
    const bool demanded = drive_.axis().demand.loop == Loop::position;
    // In torque control the velocity of the demand has no meaning.
    const double led = drive_.axis().demand.loop == Loop::torque
                           ? 0.0
                           : direction * static_cast<double>(drive_.axis().demand.velocity);
    // ... and in the velocity loop to the speed of the demand, which was at most that of the shaft when the stop
    // began.
    const double speed = std::max({0.0, direction * velocity_, demanded ? led : std::min(led, limit.speed)});
    const double place =
        demanded ? std::max(direction * position_, direction * static_cast<double>(drive_.axis().demand.position))
                 : direction * position_ + lag(speed);  // a stop may continue in the position loop
    // 605Ah and 605Eh choose the ramp of a quick stop and of a fault.
    const bool chosen = one_of(state_, {PowerState::quick_stop_active, PowerState::fault_reaction_active});
    double ramp = chosen && stop_.slope > 0.0 ? std::min(slope(), stop_.slope) : limit_slope();
    if (limit.slope > 0.0)
      ramp = ramp > 0.0 ? std::min(ramp, limit.slope) : limit.slope;  // the stop may have begun with that
    const double reach = place + stopping(speed, ramp).counts;
    const bool unknown = chosen && stop_.kind == StopKind::none;  // the ramp is not known
    // Without torque nothing brakes. A lower ramp restarts the judgement.
    if (!limit.active || (chosen && stop_.since == tick_) || unknown || !judgeable_ || mode_since_ == tick_ ||
        acceleration_ <= 0.0 || ramp < limit.slope) {
      // The ramp of a stop continues while the bench holds the shaft; afterwards the shaft gets that speed again.
      const double began = !demanded && limit.active ? limit.speed : 0.0;
      limit = {true, reach, ramp, direction * position_, std::max(direction * velocity_, began)};
      continue;
    }
    limit.slope = ramp;
    constexpr double rounding = 0.005;  // for distances of many revolutions
    const drive::LoopDemand& demand = drive_.axis().demand;
    const double still = still_rpm * counts_per_s_per_rpm_;
    // The last part of a filter's lag counts as standstill. Without a position loop the shaft swings back when the
    // integral decreases after an abrupt stop.
    const bool swings = led < still && (demanded || led > -still) &&
                        (!demanded || direction * static_cast<double>(demand.position) <= limit.furthest);
    // A shaft that swings about a standing demand may come back to where it was.
    if (!swings) limit.furthest = std::min(limit.furthest, reach);
    // A demand that moves again, or turns towards the switch, begins with the motion of the shaft, which may swing.
    const bool begins = (limit.swings && !swings) || (!limit.leads && led > 0.0);
    limit.swings = swings;
    limit.leads = led > 0.0;
    // A shaft that swings, at the limit of its torque, goes at most as far beyond a standing demand as it comes from.
    limit.swung = swings && demanded
                      ? std::max(limit.swung, direction * (static_cast<double>(demand.position) - position_))
                      : 0.0;
    if (begins && (direction * velocity_ > 4.0 * still || direction * position_ > limit.furthest))
      limit.furthest =
          std::max(limit.furthest, direction * position_ + stopping(std::max(0.0, direction * velocity_), ramp).counts);
    const double beyond = rounding * std::max(0.0, limit.furthest - limit.from) +
                          (swings ? std::max(swing_revolutions * counts_per_revolution_, limit.swung) : 0.0);
    if (direction * position_ > limit.furthest + beyond) {
      fail("limit-switch-passed", fmt::format("{:.2f} revolutions beyond, at {:.0f} rpm, mode {}",
                                              (direction * position_ - limit.furthest) / counts_per_revolution_,
                                              rpm(velocity_), static_cast<int>(mode_)));
    }
  }
}

// The distance that a demand at `speed` needs to stop by its ramp alone.
double Watch::ramp_way(double speed, double ramp) const {
  if (ramp <= 0.0) return speed * 0.1;
  const double seconds = speed / ramp + jerk_delay(speed, ramp) + 0.002 + 0.001 * drive_.configuration().smoothing_ms +
                         0.003 * static_cast<double>(drive_.configuration().position_lag_ms);
  return 0.55 * speed * seconds;
}

void Watch::software_limits() {
  const drive::Axis& axis = drive_.axis();
  // Positions wrap around at the ends of the range 607Bh. The limits are 607Dh within the range; if it allows the
  // whole range, there is no limit.
  std::int64_t least = objects_.min_position_limit;
  std::int64_t greatest = objects_.max_position_limit;
  bool bounds = true;
  if (axis.position_range() != 0) {
    bounds = least > objects_.min_position_range_limit || greatest < objects_.max_position_range_limit;
    least = std::max<std::int64_t>(least, objects_.min_position_range_limit);
    greatest = std::min<std::int64_t>(greatest, objects_.max_position_range_limit);
  }
  // Not judged if the motor has too little torque to follow the demand, because the demand then follows the shaft.
  const bool applies = bounds && least < greatest && pwm_ && state_ == PowerState::operation_enabled &&
                       axis.software_limits_active() && acceleration_ > 0.0 && !drive_.homes();
  // Cyclic targets may reach a limit at any speed. A stop that begins there needs its braking distance.
  const bool at_switch = axis.at_limit_switch();
  const unsigned stops = (told_to_stop() ? 1u : 0u) | (axis.active(drive::Signal::negative_limit) ? 2u : 0u) |
                         (axis.active(drive::Signal::positive_limit) ? 4u : 0u) | (at_switch && axis.limited ? 8u : 0u);
  if ((stops & ~std::exchange(stops_before_, stops)) != 0) stopped_since_ = tick_;
  const bool begins = stops != 0 && tick_ - stopped_since_ <= demand_cycle();  // the drive reacts in its next cycle
  // Beyond an end of the range 6064h shows the other end. By 6064h the axis is then beyond one limit, by its way beyond
  // the other one, and may leave in both directions.
  const std::int64_t turn = axis.turn_of_demand();
  const drive::Counts demand = axis.generator.nearest_position();
  const bool round = axis.units.to_user(demand) - turn != axis.to_user_position(demand);
  if (!applies || round) {
    borders_ = {};
    return;
  }
  const double asked = limit_slope();
  // From counts of the shaft to the position that 6064h shows.
  const auto offset = static_cast<double>(drive_.position_offset()) - static_cast<double>(axis.units.to_counts(turn));
  // In the position loop the demand is judged, which has no lag; otherwise the shaft.
  const bool demanded = axis.demand.loop == Loop::position;
  const double place_now = offset + (demanded ? static_cast<double>(axis.demand.position) : position_);
  const double slack = demanded ? 0.02 * counts_per_revolution_ : place_revolutions * counts_per_revolution_;
  for (std::size_t i = 0; i < 2; ++i) {
    const double direction = i == 0 ? -1.0 : 1.0;
    const std::int64_t limit = (i == 0) != axis.units.position_inverted ? least : greatest;
    Border& border = borders_[i];
    const double at = direction * static_cast<double>(axis.units.to_counts(limit));
    const double place = direction * place_now;
    // When a stop begins, the demand may move back to the shaft and continue with the shaft's velocity.
    const double shaft = direction * velocity_;
    const double led = std::max(direction * demand_speed_, direction * static_cast<double>(axis.demand.velocity));
    // A demand that moves again begins with the motion of the shaft, which may swing about its place of rest.
    const bool moves = axis.demand.velocity != 0.0F;
    const bool wakes = demanded && border.active && moves && !border.moves;
    border.moves = moves;
    const double speed = std::max({0.0, demanded ? led : shaft, begins || wakes ? shaft : 0.0});
    // A stop keeps the ramp with which it began if a steeper one is written.
    const double slope = border.active && speed > 0.0 && border.slope > 0.0 ? std::min(asked, border.slope) : asked;
    const double way = demanded ? ramp_way(speed, slope) : stopping(speed, slope).counts;
    const double reach = place + way + slack;
    if (!border.active || border.at != limit || border.turn != turn || border.demanded != demanded ||
        slope < border.slope || begins || wakes || !judgeable_ || tick_ - frame_since_ < 2 * cycle_ticks ||
        tick_ - mode_since_ < 2 * cycle_ticks || tick_ - state_since_ < 2 * cycle_ticks) {
      border = {true, demanded, limit, turn, slope, std::max(at + slack, reach), 0.0, moves};
      continue;
    }
    // In the velocity loop the drive brakes when the shaft is at the limit, and a fault also brakes from there.
    const double tolerance = demanded ? slack + 0.002 * speed : way + slack;
    border.slope = slope;
    border.bound = std::max(at + tolerance, std::min(border.bound, reach));
    // A demand that only comes up to a shaft beyond the limit does not lead the shaft there. A demand that follows the
    // shaft may rest there.
    const bool leads = !demanded || place > direction * (offset + position_);
    if (demand_tick_ == tick_) {  // the last step of a line has the velocity of the step before it
      const double own = std::max(0.0, direction * static_cast<double>(axis.demand.velocity));
      const bool taken_along =
          !leads && direction * demand_speed_ > 1.05 * std::max(own, std::exchange(border.own, own));
      if (taken_along) border.bound = std::max(border.bound, place);
    }
    if (place > border.bound && leads) {
      return fail("software-limit-passed",
                  fmt::format("{:.2f} revolutions beyond 607Dh, at {:.0f} rpm, mode {}",
                              (place - at) / counts_per_revolution_, rpm(velocity_), static_cast<int>(mode_)));
    }
  }
}

}  // namespace servodrome::motion
