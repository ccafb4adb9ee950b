#include <array>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "watch_terms.hpp"

// Stops, limit switches and software limits: where the shaft may still be.
namespace servodrome::motion {

void Watch::stops() {
  StopKind kind = StopKind::none;
  const drive::Command command = drive::command_of(objects_.controlword);
  // A set-point that is given while the DC link charges counts with Operation enabled.
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
                    (drive_.policy().modes_without_halt & drive::mode_bit(mode_)) == 0 && mode_ != Mode::none;
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
  told_ = kind;
  if (kind == StopKind::none && stop_.kind == StopKind::none) return;
  // A limit switch releases what it holds, and homing goes on where it was.
  const std::int64_t settled = tick_ - std::max({stop_.since, around_->disturbed, mode_since_});
  if (kind != stop_.kind || around_->disturbed > stop_.since || mode_since_ > stop_.since || !judgeable_) {
    if (kind == StopKind::none) {
      stop_ = {};
      return;
    }
    // A stop that goes on in another mode keeps the ramp that it began with.
    const bool goes_on = kind == stop_.kind && stop_.slope > 0.0 && slope() > 0.0;
    const double gentlest = goes_on ? std::min(slope(), stop_.slope) : slope();
    // A shaft that lags behind the stop's ramp meanwhile may become as fast again. What the drive begins with is what
    // its filter shows, a little late.
    double speed = goes_on ? std::max(std::abs(velocity_), stop_.speed) : std::max(fastest_[0], fastest_[1]);
    // Homing that is given up goes on with a ramp to rest that runs already, about which the shaft may swing.
    const bool brakes = generator.acceleration() * generator.velocity() < 0.0;
    const double off = std::abs(position_ - static_cast<double>(drive_.axis().demand.position));
    if (kind == StopKind::homing && brakes && off < swing_revolutions * counts_per_revolution_)
      speed = std::max(speed, std::abs(generator.velocity()));
    const Stopping stopping = this->stopping(speed, gentlest);
    // What the drive measures is late, and a shaft that swings may have turned meanwhile.
    const double unsure = 4.0 * still_rpm * counts_per_s_per_rpm_ + overshoot(-1.0);
    // A hard stop may have thrown it back from a stop whose demand still leads there.
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
  if (acceleration_ <= 0.0) {  // the torque that a stop needs was taken from it
    stop_.since = tick_;
    stop_.from = position_;
  }
  const bool shaped = stop_.shaped || ramp_set_.shaped;
  if (const double ramp = slope(); ramp != stop_.slope || shaped != stop_.shaped) {
    // Written while it runs: the stop may have been planned with the one of before, the loops' lag with either.
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
  constexpr double rounding = 1.005;  // of ways of many revolutions
  if (way > rounding * stop_.counts) {
    return fail("stop-runs-away",
                fmt::format("{}: {:.2f} revolutions after {:.1f} ms, at {:.0f} rpm; {:.2f} are enough for it", name,
                            way / counts_per_revolution_, static_cast<double>(settled) / ticks_per_ms, rpm(velocity_),
                            stop_.counts / counts_per_revolution_));
  }
  // While a brake opens the axis is held where it is, whatever it did before.
  const bool held = stop_.since - pwm_since_ <= ms(drive_.configuration().brake_release_ms);
  if (kind < StopKind::velocity && !held && acceleration_ > 0.0 && drive_.axis().demand.loop == Loop::position &&
      stop_.furthest - place > swing_revolutions * counts_per_revolution_ + 0.1 * way) {
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

// Of vl velocity mode: bits 4 to 6 of the controlword ramp down, or 6042h is 0; a locked ramp holds what it has.
bool Watch::commands_no_velocity() const {
  const std::uint16_t word = drive_.axis().controlword;
  if ((word & controlword::mode_bit_4) == 0) return true;
  if ((word & controlword::mode_bit_5) == 0) return false;
  return (word & controlword::mode_bit_6) == 0 || objects_.vl_target_velocity == 0;
}

// A soft loop may swing for long about a demand that rests at the end of its ramp.
bool Watch::swings_about_rest() const {
  const drive::LoopDemand& demand = drive_.axis().demand;
  return demand.loop == Loop::position && demand.velocity == 0.0F &&
         std::abs(position_ - static_cast<double>(demand.position)) < swing_revolutions * counts_per_revolution_;
}

void Watch::limit_switches() {
  if (drive_.policy().limit_switches != drive::LimitSwitches::stop) return;
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
    // Under torque the switch bounds the speed, which a load on the axis has for as long as the loop's integral needs.
    const bool loaded = drive_.axis().demand.loop == Loop::torque && around_->load_share != 0.0;
    const bool active = closed && signal && pwm_ && has_stage(state_) && !drive_.homes() && !loaded;
    Limit& limit = limits_[i];
    if (!active) {  // a bounce lets a stop go on with the ramp that it has
      limit = {.slope = moves ? limit.slope : 0.0};
      continue;
    }
    // In the position loop the shaft comes to where the demand stands, though it may have swung back from there.
    const bool demanded = drive_.axis().demand.loop == Loop::position;
    const double led = direction * static_cast<double>(drive_.axis().demand.velocity);
    // ... and in the velocity loop to the demand's speed, which was that of the shaft when the stop began.
    const double speed = std::max({0.0, direction * velocity_, demanded ? led : std::min(led, limit.speed)});
    const double place =
        demanded ? std::max(direction * position_, direction * static_cast<double>(drive_.axis().demand.position))
                 : direction * position_ + lag(speed);  // a stop may go on in the position loop
    // 605Ah and 605Eh choose the ramp of a quick stop and of a fault.
    const bool chosen = one_of(state_, {PowerState::quick_stop_active, PowerState::fault_reaction_active});
    double ramp = chosen && stop_.slope > 0.0 ? std::min(slope(), stop_.slope) : limit_slope();
    if (limit.slope > 0.0)
      ramp = ramp > 0.0 ? std::min(ramp, limit.slope) : limit.slope;  // it may have begun with that
    const double reach = place + stopping(speed, ramp).counts;
    const bool unknown = chosen && stop_.kind == StopKind::none;  // which ramp it is
    // Without torque nothing brakes. A gentler ramp that is written meanwhile is that of the next stop.
    if (!limit.active || (chosen && stop_.since == tick_) || unknown || !judgeable_ || mode_since_ == tick_ ||
        acceleration_ <= 0.0 || ramp < limit.slope) {
      // The ramp of a stop goes on while the bench holds the shaft, which has its speed again afterwards.
      const double began = !demanded && limit.active ? limit.speed : 0.0;
      limit = {true, reach, ramp, direction * position_, std::max(direction * velocity_, began)};
      continue;
    }
    limit.slope = ramp;
    constexpr double rounding = 0.005;  // of ways of many revolutions
    const drive::LoopDemand& demand = drive_.axis().demand;
    const double still = still_rpm * counts_per_s_per_rpm_;
    // The end of a filter's lag is no motion. Without a position loop the shaft swings back when the integral of a hard
    // stop unwinds.
    const bool swings = led < still && (demanded || led > -still) &&
                        (!demanded || direction * static_cast<double>(demand.position) <= limit.furthest);
    // A shaft that swings about a demand which leads nowhere comes back as far as it was.
    if (!swings) limit.furthest = std::min(limit.furthest, reach);
    // A demand that moves again, or turns towards the switch, begins with what the shaft does, which may swing.
    const bool begins = (limit.swings && !swings) || (!limit.leads && led > 0.0);
    limit.swings = swings;
    limit.leads = led > 0.0;
    if (begins && (direction * velocity_ > 4.0 * still || direction * position_ > limit.furthest))
      limit.furthest =
          std::max(limit.furthest, direction * position_ + stopping(std::max(0.0, direction * velocity_), ramp).counts);
    const double beyond = rounding * std::max(0.0, limit.furthest - limit.from) +
                          (swings ? swing_revolutions * counts_per_revolution_ : 0.0);
    if (direction * position_ > limit.furthest + beyond) {
      fail("limit-switch-passed", fmt::format("{:.2f} revolutions beyond, at {:.0f} rpm, mode {}",
                                              (direction * position_ - limit.furthest) / counts_per_revolution_,
                                              rpm(velocity_), static_cast<int>(mode_)));
    }
  }
}

// What a demand at `speed` needs to rest by the ramps alone.
double Watch::ramp_way(double speed, double ramp) const {
  if (ramp <= 0.0) return speed * 0.1;
  const double seconds = speed / ramp + jerk_delay(speed, ramp) + 0.002 + 0.001 * drive_.configuration().smoothing_ms +
                         0.003 * static_cast<double>(drive_.configuration().position_lag_ms);
  return 0.55 * speed * seconds;
}

void Watch::software_limits() {
  const drive::Axis& axis = drive_.axis();
  // Behind an end of the range 607Bh lie the positions of its other end. What 607Dh leaves of the range is allowed,
  // unless that is all of it.
  std::int64_t least = objects_.min_position_limit;
  std::int64_t greatest = objects_.max_position_limit;
  bool bounds = true;
  if (axis.position_range() != 0) {
    bounds = least > objects_.min_position_range_limit || greatest < objects_.max_position_range_limit;
    least = std::max<std::int64_t>(least, objects_.min_position_range_limit);
    greatest = std::min<std::int64_t>(greatest, objects_.max_position_range_limit);
  }
  // A demand that the motor has no torque to follow is taken along by the shaft.
  const bool applies = bounds && least < greatest && pwm_ && state_ == PowerState::operation_enabled &&
                       axis.software_limits_active() && acceleration_ > 0.0 && !drive_.homes();
  // A cyclic target may end at a limit at any speed; a stop that begins there needs its way.
  const bool at_switch = axis.at_limit_switch();
  const unsigned stops = (told_to_stop() ? 1u : 0u) | (axis.active(drive::Signal::negative_limit) ? 2u : 0u) |
                         (axis.active(drive::Signal::positive_limit) ? 4u : 0u) | (at_switch && axis.limited ? 8u : 0u);
  if ((stops & ~std::exchange(stops_before_, stops)) != 0) stopped_since_ = tick_;
  const bool begins = stops != 0 && tick_ - stopped_since_ <= demand_cycle();  // the drive hears of it with its cycle
  if (!applies) {
    borders_ = {};
    return;
  }
  const double asked = limit_slope();
  // As 6064h shows it.
  const auto offset =
      static_cast<double>(drive_.position_offset()) - static_cast<double>(axis.units.to_counts(axis.turn_of_demand()));
  // In the position loop the demand is judged, which has no lag; else the shaft.
  const bool demanded = axis.demand.loop == Loop::position;
  const double place_now = offset + (demanded ? static_cast<double>(axis.demand.position) : position_);
  const double slack = demanded ? 0.02 * counts_per_revolution_ : place_revolutions * counts_per_revolution_;
  for (std::size_t i = 0; i < 2; ++i) {
    const double direction = i == 0 ? -1.0 : 1.0;
    const std::int64_t limit = (i == 0) != axis.units.position_inverted ? least : greatest;
    Border& border = borders_[i];
    const double at = direction * static_cast<double>(axis.units.to_counts(limit));
    const double place = direction * place_now;
    // A demand that is taken over by a stop moves back, and goes on with its velocity.
    const double shaft = direction * velocity_;
    const double led = std::max(direction * demand_speed_, direction * static_cast<double>(axis.demand.velocity));
    // A demand that moves again goes on with what the shaft does, which may swing about where it rested.
    const bool moves = axis.demand.velocity != 0.0F;
    const bool wakes = demanded && border.active && moves && !border.moves;
    border.moves = moves;
    const double speed = std::max({0.0, demanded ? led : shaft, begins || wakes ? shaft : 0.0});
    // A stop keeps the ramp that it began with when a steeper one is written.
    const double slope = border.active && speed > 0.0 && border.slope > 0.0 ? std::min(asked, border.slope) : asked;
    const double way = demanded ? ramp_way(speed, slope) : stopping(speed, slope).counts;
    const double reach = place + way + slack;
    if (!border.active || border.at != limit || border.demanded != demanded || slope < border.slope || begins ||
        wakes || !judgeable_ || tick_ - frame_since_ < 2 * cycle_ticks || tick_ - mode_since_ < 2 * cycle_ticks ||
        tick_ - state_since_ < 2 * cycle_ticks) {
      border = {true, demanded, limit, slope, std::max(at + slack, reach), 0.0, moves};
      continue;
    }
    // A demand in the velocity loop is braked when the shaft is there; a fault brakes from there as well.
    const double tolerance = demanded ? slack + 0.002 * speed : way + slack;
    border.slope = slope;
    border.bound = std::max(at + tolerance, std::min(border.bound, reach));
    // A demand that comes to a shaft which is already there leads it nowhere. One that the shaft takes along may rest
    // there.
    const bool leads = !demanded || place > direction * (offset + position_);
    if (demand_tick_ == tick_) {  // the last step of a line has the velocity of the one before
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
