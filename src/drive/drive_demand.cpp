#include "drive/rounding.hpp"
#include "drive/with_mode.hpp"

// The steps from a mode's demand to the loops: limits, smoothing, holding at standstill.
namespace servodrome::drive {

namespace {

constexpr std::uint32_t averaged_modes = mode_bit(Mode::profile_position) | mode_bit(Mode::profile_velocity);
constexpr std::uint32_t lagging_modes =
    mode_bit(Mode::profile_position) | mode_bit(Mode::interpolated_position) | mode_bit(Mode::cyclic_sync_position);

}  // namespace

// The direction of the motion that the demand asks for. If the demand has ended or reversed, but the shaft still
// follows the smoothed demand or lags behind, it is the direction in which the shaft still moves. `before`: the demand
// before this cycle.
double Drive::demanded_direction(Counts before) const {
  constexpr double moving_rpm = 30.0;
  constexpr double settling_s = 0.05;  // a shaft that arrives within this time settles at its target
  const auto smoothed = static_cast<double>(smoothing_.velocity());
  if (demand_lags() && axis_.runs_into_limit_switch(smoothed)) return smoothed;
  const double direction = axis_.demand_direction(before);
  const double shaft = axis_.velocity();
  if (direction != 0.0 || std::abs(shaft) < axis_.rpm_to_counts_per_s(moving_rpm)) return direction;
  if (axis_.demand.loop != Loop::position) return velocity_of_demand() * shaft > 0.0 ? shaft : 0.0;
  // With a soft position loop the shaft may be far behind its demand. It then still moves on if a quick stop would end
  // before the demand.
  const double quick = quick_stop_deceleration();
  const double stop = quick > 0.0 ? shaft * shaft / (2.0 * quick) : 0.0;
  const auto ahead = static_cast<double>(axis_.generator.nearest_position() - axis_.position());
  const double least = std::min(axis_.lag(shaft), stop) + settling_s * std::abs(shaft);
  return ahead * std::copysign(1.0, shaft) > least ? shaft : 0.0;
}

// The velocity that the velocity loop gets, counts/s: the smoothed one while that is higher or has not reversed yet.
double Drive::velocity_of_demand() const {
  const double velocity = axis_.generator.velocity();
  const auto smoothed = static_cast<double>(smoothing_.velocity());
  const bool leads = std::abs(smoothed) > std::abs(velocity) || smoothed * velocity < 0.0;
  return demand_lags() && axis_.demand.loop == Loop::velocity && leads ? smoothed : velocity;
}

// Returns true if the demand leads towards an active limit switch: by its velocity, in torque control by its torque. A
// position demand that returns to a standing shaft, as at the end of a stream of targets, does not count.
bool Drive::pushes_limit_switch(Counts before) const {
  if (!axis_.at_limit_switch()) return false;
  const LoopDemand& demand = axis_.demand;
  const double towards = demand.loop == Loop::torque ? static_cast<double>(demand.torque) : demanded_direction(before);
  const auto ahead = static_cast<double>(axis_.generator.nearest_position() - axis_.position());
  constexpr double moving_rpm = 30.0;
  const bool moves = axis_.velocity() * std::copysign(1.0, towards) > axis_.rpm_to_counts_per_s(moving_rpm);
  if (demand.loop == Loop::position && ahead * towards <= 0.0 && !moves) return false;
  return axis_.runs_into_limit_switch(towards);
}

// Returns true if a software limit, changed in motion, is ahead of the smoothed position demand but behind the demand
// of the generator, and the smoothed demand can just stop before it.
bool Drive::smoothing_passes_software_limit() const {
  if (!smoothing_.lags(Loop::position) || !axis_.keeps_software_limits()) return false;
  const auto velocity = static_cast<double>(smoothing_.velocity());
  const auto ahead = [velocity](const Axis::Room& room) { return velocity < 0.0 ? room.below : room.above; };
  if (velocity == 0.0 || ahead(axis_.room_from(axis_.generator.nearest_position())) >= 0.0) return false;
  const double quick = quick_stop_deceleration();
  const double way = quick > 0.0 ? velocity * velocity / (2.0 * quick) : 0.0;
  return ahead(axis_.room_from(smoothing_.position_counts() + axis_.offset)) < way + std::abs(velocity) * axis_.cycle_s;
}

// Unless homing runs, a limit switch ends every motion towards it, or raises a fault (LimitPolicy::switches). Motion
// away from it is free. In modes that control the velocity, a software limit ends the motion too, early enough to stop
// at the limit. For modes that control the torque see set_limits(). `before`: the demand before this cycle.
void Drive::limit_switches(Counts before) {
  if (homes()) return;
  if (policy_.limits.switches == LimitSwitches::fault) {
    if (pushes_limit_switch(before)) axis_.raise(Cause::position_limit);
    return;
  }
  if (axis_.demand.loop == Loop::torque) return;
  if (smoothing_passes_software_limit()) {
    // The mode goes on from the smoothed demand, and keeps to the limit as it does without smoothing.
    axis_.limited = true;
    take_over_shaft();
    axis_.come_to_rest(RampShape::linear, axis_.quick_stop_ramp());
    with_mode(*this, [&](auto& mode) { mode.resume(axis_); });
    axis_.follow_generator(axis_.demand.loop);
    return;
  }
  const double velocity = velocity_of_demand();
  const bool bounds_velocity = axis_.demand.loop == Loop::velocity && velocity != 0.0;
  if (!bounds_velocity && !axis_.at_limit_switch()) return;
  const double quick = quick_stop_deceleration();
  const double moves = demanded_direction(before);
  int blocked = !axis_.runs_into_limit_switch(moves) ? 0 : moves < 0.0 ? -1 : 1;
  if (bounds_velocity) {
    const bool near = axis_.near_software_limit(velocity, quick);
    axis_.stopped_at = !near ? 0 : velocity < 0.0 ? -1 : 1;
    if (near) blocked = axis_.stopped_at;
  }
  if (blocked == 0) return;
  if (!policy_.status.limit_switches_show_as_limit) axis_.limited = true;
  constexpr double slow_rpm = 10.0;
  const bool slow =
      std::abs(axis_.velocity()) <= std::min(4.0 * quick * axis_.cycle_s, axis_.rpm_to_counts_per_s(slow_rpm));
  const bool stands = axis_.demand_direction(before) == 0.0;
  if (!slow || smoothing_.lags() || stands) {
    begin_stop(Stop::quick_stop_ramp, stands && !demand_lags());
    stop_.set_at_limit();
  } else {
    axis_.generator.reset(before);
    axis_.follow_generator(axis_.demand.loop);
  }
  with_mode(*this, [&](auto& mode) { mode.interrupt(axis_, blocked); });
}

// Some products hold the axis as a stepper does, by a constant current, so that the axis does not hunt at standstill.
void Drive::hold_by_current() {
  const float current_a = axis_.configuration.standstill_current_a;
  const bool may = current_a > 0.0F && mode_ == Mode::profile_position && state_ == PowerState::operation_enabled &&
                   stage_.is_on() && !stop_.active() && !pending_.active && !identification_.running() &&
                   axis_.generator.standing();
  held_by_current_ = may && (held_by_current_ || (axis_.objects.statusword & statusword::target_reached) != 0);
  if (!held_by_current_) return;
  axis_.demand.loop = Loop::locked;
  axis_.demand.lock_current_a = current_a;
}

// The required smoothing of the demand: the moving average in modes with a profile, or the low pass of a position
// command.
DemandSmoothing::Filter Drive::smoothing_asked_for() const {
  const Configuration& configuration = axis_.configuration;
  const std::uint32_t mode = mode_bit(mode_);
  const Loop loop = axis_.demand.loop;
  const std::uint32_t cycles = axis_.cycles(configuration.smoothing_ms);
  if (cycles > 1 && (mode & averaged_modes) != 0 && (loop == Loop::position || loop == Loop::velocity))
    return {std::min<std::size_t>(cycles, MovingAverage::longest), 0.0F};
  if (loop == Loop::position && (mode & lagging_modes) != 0) return {0, configuration.position_lag_ms};
  return {};
}

// The demand in units of the smoothed demand. Empty while the demand changes.
std::optional<std::int64_t> Drive::standing_demand() const {
  const Generator& generator = axis_.generator;
  if (!generator.standing()) return {};
  return (generator.position() - axis_.offset) * DemandSmoothing::unit +
         round_to_integer(generator.fraction() * static_cast<double>(DemandSmoothing::unit));
}

// Stops are not delayed: a stop continues from the smoothed demand (take_over_shaft). `from`: the demand, if it was
// constant before this cycle.
void Drive::smooth_demand(std::optional<std::int64_t> from) {
  if (!stage_.is_on() || stop_.active()) return smoothing_.stop();
  smoothing_.apply(axis_.demand, smoothing_asked_for(), from, held_by_current_, axis_.cycle_s, axis_.cycles_per_ms);
}

// Torque of the configured weight and friction. While the axis stands, the direction of the last motion counts, so that
// the torque does not jump at the end of a motion.
float Drive::known_load() {
  const Configuration& configuration = axis_.configuration;
  const LoopDemand& demand = axis_.demand;
  if (demand.loop != Loop::position && !zero_speed_) {
    friction_direction_ = 0;
    return 0.0F;
  }
  if (demand.velocity != 0.0F) friction_direction_ = demand.velocity > 0.0F ? 1 : -1;
  const float friction = friction_direction_ > 0   ? configuration.friction_torque_positive
                         : friction_direction_ < 0 ? configuration.friction_torque_negative
                                                   : 0.0F;
  return configuration.weight_torque + friction;
}

void Drive::note_demand_source() {
  const bool by_mode = state_ == PowerState::operation_enabled && stage_.is_on() && !stop_.active();
  const Mode source = by_mode ? mode_ : Mode::none;
  axis_.demand.hands_over = source != demand_source_;
  demand_source_ = source;
}

// If the speed limit is lowered in motion, the axis slows down by the mode's ramp; a stop keeps its own ramp. A shaft
// that is faster than the limit when it gets power slows down in the same way.
void Drive::update_greatest_velocity() {
  const double set = axis_.max_velocity(false);
  greatest_of_rpm_ = axis_.objects.max_motor_speed_rpm;
  double& now = axis_.greatest_velocity;
  if (!energised()) {
    now = std::max(set, std::abs(axis_.turning_velocity()));
  } else if (now > set) [[unlikely]] {
    double ramp = with_mode(*this, [&](const auto& mode) { return mode.deceleration(axis_); });
    if (ramp <= 0.0) ramp = quick_stop_deceleration();
    // If the shaft does not follow the demand, for example because targets come less often than 60C2h says, the speed
    // of the demand is not that of the axis. The ramp then begins at the speed of the shaft.
    const double shaft = std::abs(axis_.velocity());
    const bool lowered = set < set_greatest_velocity_;
    const bool moves = !lowered || axis_.follows_demand();
    const double used = moves ? std::max(std::abs(axis_.generator.velocity()), shaft) : shaft;
    const double step = stop_.active() ? 0.0 : ramp * axis_.cycle_s;
    now = ramp > 0.0 ? std::max(set, std::min(now, used) - step) : set;
  } else {
    now = set;
  }
  set_greatest_velocity_ = set;
}

// The product's own limit of the speed in one direction. Like greatest_velocity, a limit that is lowered under way
// falls by the mode's ramp, and is not above the speed of the axis meanwhile. `before`: the limit of the loops in the
// cycle before; `speed`: towards the limit, counts/s, the greater one of shaft and demand.
float Drive::own_velocity_limit(bool positive, float before, float speed) {
  const Configuration& own = axis_.configuration;
  float set = positive ? own.velocity_limit_positive : own.velocity_limit_negative;
  const auto& in_torque_mode = positive ? own.torque_mode_velocity_positive : own.torque_mode_velocity_negative;
  if (axis_.demand.loop == Loop::torque && in_torque_mode) set = std::min(set, static_cast<float>(*in_torque_mode));
  const float from = std::min(before, std::max(set, speed));
  if (!energised() || from <= set) [[likely]]
    return set;
  double ramp = with_mode(*this, [&](const auto& mode) { return mode.deceleration(axis_); });
  if (ramp <= 0.0) ramp = quick_stop_deceleration();
  if (ramp <= 0.0) return set;
  return std::max(set, from - (stop_.active() ? 0.0F : static_cast<float>(ramp * axis_.cycle_s)));
}

void Drive::set_limits() {
  const Objects& objects = axis_.objects;
  const MotorData& motor = axis_.configuration.motor;
  LoopDemand& demand = axis_.demand;
  const float by_current = static_cast<float>(objects.max_current * axis_.units.current) * motor.rated_current_a *
                           motor.torque_constant_nm_per_a / motor.rated_torque_nm;
  const float common =
      std::min({static_cast<float>(objects.max_torque) * 0.001F, by_current, supervision_.allowed_torque()});
  demand.torque_limit_positive = std::min(static_cast<float>(objects.positive_torque_limit) * 0.001F, common);
  demand.torque_limit_negative = std::min(static_cast<float>(objects.negative_torque_limit) * 0.001F, common);
  if (axis_.units.velocity_inverted) std::swap(demand.torque_limit_positive, demand.torque_limit_negative);
  if (const int direction = presses(); direction != 0) {
    // While the axis presses against a hard stop, the torque towards it is limited to the value that the detection of
    // the stop needs. The other direction has its full torque, to hold a load that pulls towards the stop.
    float& towards = direction > 0 ? demand.torque_limit_positive : demand.torque_limit_negative;
    towards = std::min(towards, 1.1F * axis_.configuration.homing_stall_torque);
  }
  demand.integral_off = axis_.active(Signal::integral_off);
  if (mode_ == Mode::homing && homing_mode_.active() && axis_.configuration.homing_torque_limit > 0.0F) {
    demand.torque_limit_positive = std::min(demand.torque_limit_positive, axis_.configuration.homing_torque_limit);
    demand.torque_limit_negative = std::min(demand.torque_limit_negative, axis_.configuration.homing_torque_limit);
  }
  const auto most = static_cast<float>(axis_.greatest_velocity);
  const auto shaft = static_cast<float>(axis_.velocity());
  const float demanded = demand.loop == Loop::torque ? shaft : demand.velocity;
  demand.velocity_limit_positive =
      std::min(most, own_velocity_limit(true, demand.velocity_limit_positive, std::max(shaft, demanded)));
  demand.velocity_limit_negative =
      std::min(most, own_velocity_limit(false, demand.velocity_limit_negative, std::max(-shaft, -demanded)));
  if (demand.loop == Loop::torque) {
    if (axis_.active(Signal::positive_limit)) demand.velocity_limit_positive = 0.0F;
    if (axis_.active(Signal::negative_limit)) demand.velocity_limit_negative = 0.0F;
    // The greatest speed from which the axis can stop before its software limit.
    const Axis::Room room = axis_.kept_room();
    const auto approach = [quick = quick_stop_deceleration(), most](double way) {
      if (way <= 0.0) return 0.0F;
      return quick > 0.0 ? static_cast<float>(std::sqrt(2.0 * quick * way)) : most;
    };
    demand.velocity_limit_positive = std::min(demand.velocity_limit_positive, approach(room.above));
    demand.velocity_limit_negative = std::min(demand.velocity_limit_negative, approach(room.below));
  }
  const Configuration& own = axis_.configuration;
  demand.torque_limit_positive = std::min(demand.torque_limit_positive, own.torque_limit_positive);
  demand.torque_limit_negative = std::min(demand.torque_limit_negative, own.torque_limit_negative);
}

}  // namespace servodrome::drive
