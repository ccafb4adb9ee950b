#include "drive/tuning/inertia_identification.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::drive {
namespace {

constexpr float probing_per_s = 0.4F;  // rise of the torque until the axis moves, rated torques per second
constexpr double swing_goal_s = 0.1;   // from one reversal to the next
constexpr double late_swing_s = 0.4;
constexpr float swing_slope_s = 5.0e-3F;     // duration of a torque reversal; a step would excite resonances
constexpr float most_change = 3.0F;          // greatest ratio of the amplitudes of two consecutive swings
constexpr float least_over_friction = 1.5F;  // least amplitude / breakaway torque
constexpr double turning_share = 0.35;       // fraction of the travel at which a swing ends at any speed
constexpr double moving_counts = 8.0;        // the axis counts as moving
constexpr std::uint32_t least_reversals = 5;

}  // namespace

bool InertiaIdentification::begin(Axis& axis, const Request& request) {
  const MotorData& motor = axis.configuration.motor;
  const Axis::Room room = axis.room_from(axis.position());
  const double travel_counts = std::min({request.travel_counts, room.below, room.above});
  if (running() || travel_counts <= 4.0 * moving_counts || request.speed_counts_per_s <= 0.0 ||
      request.torque_limit <= 0.0F) {
    return false;
  }
  *this = {};
  request_ = request;
  request_.speed_counts_per_s = std::min(request.speed_counts_per_s, 0.5 * axis.max_velocity(false));
  request_.travel_counts = travel_counts;
  origin_ = axis.encoder_position;
  cycle_s_ = axis.cycle_s;
  // A direct current that holds the rotor has no torque reference.
  holding_ = axis.demand.loop == Loop::locked ? axis.loops->load_torque : axis.loops->torque_reference;
  estimator_.begin({.counts_per_revolution = static_cast<double>(motor.counts_per_revolution),
                    .rated_torque_nm = static_cast<double>(motor.rated_torque_nm),
                    .cycle_s = axis.cycle_s});
  outcome_ = Outcome::running;
  return true;
}

void InertiaIdentification::reverse() {
  direction_ = -direction_;
  if (reversals_ > 0) {
    // The duration of a swing depends on the torque that exceeds friction.
    const auto ratio = static_cast<float>(swing_s_ / swing_goal_s);
    const float over_friction = std::max(amplitude_ - breakaway_, 0.5F * breakaway_);
    amplitude_ = breakaway_ + over_friction * std::clamp(ratio, 1.0F / most_change, most_change);
  }
  amplitude_ =
      std::clamp(amplitude_, std::min(least_over_friction * breakaway_, request_.torque_limit), request_.torque_limit);
  swing_s_ = 0.0;
  ++reversals_;
}

// Returns true if the axis is beyond a software limit, or moves towards one and can just stop before it by the quick
// stop.
bool InertiaIdentification::meets_software_limit(const Axis& axis) {
  const double velocity = axis.velocity();
  const Axis::Room room = axis.room_from(axis.position());
  const double quick = axis.quick_stop_ramp();
  const double way = quick > 0.0 ? velocity * velocity / (2.0 * quick) : 0.0;
  return std::min(room.below, room.above) < 0.0 ||
         (velocity < 0.0 ? room.below : room.above) < way + std::fabs(velocity) * axis.cycle_s;
}

void InertiaIdentification::step(Axis& axis) {
  const auto way = static_cast<double>(axis.encoder_position - origin_);
  const double velocity = axis.velocity();
  const double towards = direction_ * velocity;  // > 0: in the direction of the swing
  elapsed_s_ += cycle_s_;
  swing_s_ += cycle_s_;
  if (std::fabs(way) > request_.travel_counts) return abort(Outcome::travel_exceeded);
  if ((axis.active(Signal::negative_limit) && velocity < 0.0) ||
      (axis.active(Signal::positive_limit) && velocity > 0.0)) {
    return abort(Outcome::limit_switch);
  }
  if (meets_software_limit(axis)) return abort(Outcome::travel_exceeded);
  if (!probing_) estimator_.sample(axis.encoder_position, axis.loops->mean_torque);
  if (probing_ || swing_s_ > late_swing_s) {
    // Raise the torque until the axis moves, or if a swing takes too long because the holding torque was biased to one
    // side.
    amplitude_ += probing_per_s * static_cast<float>(cycle_s_);
    if (breakaway_ == 0.0F && std::fabs(way) > moving_counts) breakaway_ = amplitude_;
    if (amplitude_ > request_.torque_limit) {
      if (breakaway_ == 0.0F) return abort(Outcome::no_motion);
      amplitude_ = request_.torque_limit;
    }
  }

  const bool fast = towards >= request_.speed_counts_per_s;
  const bool far = direction_ * way >= turning_share * request_.travel_counts && towards > 0.0;
  if (!ending_ && (fast || far)) {
    probing_ = false;
    reverse();
    const bool good = estimator_.estimate(estimate_) && estimate_.relative_uncertainty < request_.uncertainty;
    if (reversals_ >= least_reversals && good) ending_ = true;
    if (estimate_.windows != 0)
      holding_ = static_cast<float>(estimate_.constant_nm) / axis.configuration.motor.rated_torque_nm;
  } else if (ending_ && towards >= 0.0) {
    outcome_ = Outcome::done;  // the return swing has brought the axis to rest
  }
  if (elapsed_s_ > request_.timeout_s) return abort(Outcome::not_converged);

  const float goal = running() ? static_cast<float>(direction_) * amplitude_ : 0.0F;
  const float slope = 2.0F * amplitude_ * static_cast<float>(cycle_s_) / swing_slope_s;
  level_ = running() ? level_ + std::clamp(goal - level_, -slope, slope) : 0.0F;
  axis.demand.loop = Loop::torque;
  axis.demand.torque = holding_ + level_;
  axis.demand.velocity = 0.0F;
  axis.demand.acceleration = 0.0F;
  axis.generator.start_from(axis.position(), velocity);
}

}  // namespace servodrome::drive
