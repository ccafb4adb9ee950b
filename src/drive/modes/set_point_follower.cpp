#include "drive/modes/set_point_follower.hpp"

#include <utility>

namespace servodrome::drive {

void InterpolationPeriod::update(const Axis& axis) {
  value_ = axis.objects.interpolation_time_period_value;
  index_ = axis.objects.interpolation_time_index;
  set_s_ = axis.configuration.set_point_period_s;
  if (set_s_ > 0.0) {
    cycles_ = std::clamp(set_s_ / axis.cycle_s, 1.0, 1e6);
    return;
  }
  double scale = 1.0;  // the powers of ten that occur are exact
  for (int n = std::abs(int{index_}); n > 0; --n) scale *= 10.0;
  const double cycles = value_ * (1000.0 * axis.cycles_per_ms);
  cycles_ = std::clamp(index_ < 0 ? cycles / scale : cycles * scale, 1.0, 1e6);
}

namespace {

// Tolerance of a cyclic target's time, in cycles. A target is on time in the first cycle at or after its due time.
constexpr double jitter = 1.0;
constexpr bool too_late(double due) { return due <= -jitter - 1.0; }
// Values for the mean deviation of the targets from their due times: the permitted deviation in cycles (a period that
// is no multiple of the cycle causes up to a half), and the weight of one target in the mean.
constexpr double phase_slack = 0.6;
constexpr double phase_share = 1.0 / 32.0;
// Weight of one SYNC for the time base that is locked to it, unless its deviation exceeds the jitter of a bus.
constexpr double lock_share = 1.0 / 8.0;
constexpr double lock_range = 1.0;      // cycles
constexpr double shortest_line = 0.25;  // cycles

}  // namespace

// Converts a target in user units to counts. `last` is the previous target.
Counts resolve_cyclic_target(Axis& axis, std::int64_t user, Counts last) {
  axis.limited = false;
  axis.commanded = user;
  const bool limits = axis.software_limits_active();
  if (limits) {  // within the range 607Bh, if it is set
    const Axis::UserLimits bounds = axis.software_limits();
    const std::int64_t clipped = std::clamp(user, bounds.least, bounds.greatest);
    if (clipped != user && axis.policy.limits.target_beyond == OutOfLimits::fault) axis.raise(Cause::position_limit);
    axis.limited = clipped != user;
    user = clipped;
  }
  // A cyclic target never means half a turn in one cycle, so the shorter way applies: around the range 607Bh, from the
  // previous target, or around the 32 bits of the object, from the present demand.
  if (const std::int64_t range = axis.position_range(); range != 0) {
    const std::int64_t now = axis.units.to_user(last);
    std::int64_t distance = (user - now) % range;
    if (distance > range / 2) distance -= range;
    if (distance < -(range / 2)) distance += range;
    // The other direction leads through positions that 607Dh forbids.
    user = axis.limits_bound_range() ? axis.turn_of(last) + user : now + distance;
  } else if (limits) {  // the limits forbid wrapping around the 32 bits
    user += axis.turn_of_demand();
  } else {
    const std::int64_t now = axis.units.to_user(axis.generator.nearest_position());
    user = now + wrap_to_32_bits(user - now);
  }
  return axis.units.to_counts(user);
}

// Before the first target of a mode, any earlier motion of the axis comes to rest.
void await_target(Axis& axis) {
  axis.rest_within_limits();
  axis.generator.step(axis.cycle_s);
  axis.follow_generator(Loop::position);
}

double bridging_rate(double before, double rate) {
  if (before * rate <= 0.0 || std::abs(rate) >= std::abs(before)) return rate;
  const double slower = 2.0 * rate - before;
  return slower * rate > 0.0 ? slower : 0.0;
}

void end_bridge(Axis& axis, Line& line, LineDemand& demand, Counts target, double cycles) {
  Generator& generator = axis.generator;
  if (demand.on_line()) {
    generator.place(generator.position(), generator.fraction(), 0.0);
    demand.begin(axis, line, target, cycles);
  }
  line.go(target, cycles);
}

bool given_up_at_limits(Axis& axis, Counts target) {
  if (axis.within_software_limits(target)) return false;
  if (axis.policy.limits.target_beyond == OutOfLimits::fault) {
    axis.raise(Cause::position_limit);
    return false;
  }
  axis.limited = true;
  axis.come_to_rest(RampShape::linear, axis.quick_stop_ramp());
  return true;
}

bool runs_beyond_limits(const Axis& axis, Line line) {
  if (!axis.software_limits_active()) return false;
  line.step(true);
  const Axis::UserLimits bounds = axis.software_limits();
  const std::int64_t user = axis.to_user_position(line.now());
  return user < bounds.least || user > bounds.greatest;
}

// If 607Dh was changed so that it excludes the last target, the axis comes to rest, and the next target counts as the
// first.
void SetPointFollower::keep_to_limits(Axis& axis) {
  if (following_ && given_up_at_limits(axis, target_)) stop();
}

// Returns true if the line continues from the previous target. False: a new line begins, to reach the target in
// `cycles`.
bool SetPointFollower::begin(Axis& axis, std::int64_t user, double cycles) {
  keep_to_limits(axis);
  // While the line bridges a missing target, a target that arrives long before its due time is the missing target,
  // late.
  const bool lost_one = std::exchange(bridging_, false) && due_ > 2.0 * jitter;
  if (following_) return !too_late(due_) && !lost_one;
  following_ = true;
  target_ = axis.generator.nearest_position();
  demand_.begin(axis, line_, resolve_cyclic_target(axis, user, target_), cycles);
  return false;
}

void SetPointFollower::follow_sync(Axis& axis, std::int64_t user, double age) {
  const double period = period_.cycles(axis);
  const bool locked = following_;
  regular_ = begin(axis, user, period);
  slack_ = locked ? std::max(slack_, age) : age;
  const double now = slack_ - age;
  const double off = sync_due_ - now;
  sync_due_ = locked && std::abs(off) <= lock_range ? sync_due_ - off * lock_share : now;
  due_ = std::max(shortest_line, sync_due_ + period);
  sync_due_ += axis.configuration.sync_period_s > 0.0 ? axis.configuration.sync_period_s / axis.cycle_s : period;
  lead_to(axis, user);
}

void SetPointFollower::follow(Axis& axis, std::int64_t user) {
  const double period = period_.cycles(axis);
  regular_ = begin(axis, user, period);
  if (!regular_) {  // the first target after a pause is due one period from now
    due_ = period;
    phase_ = 0.0;
  } else {  // due one period after the previous one
    due_ = std::min(due_, 2.0 * jitter);
    // The clocks of master and drive differ. The time base follows targets that are always early or late.
    phase_ += (due_ - phase_) * phase_share;
    if (std::abs(phase_) > phase_slack) due_ -= phase_ * phase_share;
    due_ = std::max(1.0, due_ + period);
  }
  lead_to(axis, user);
}

// If the speed of a line differs widely from that of the previous line, the target is a jump and not part of a stream.
void SetPointFollower::lead_to(Axis& axis, std::int64_t user) {
  const double before = line_.rate();
  target_ = resolve_cyclic_target(axis, user, target_);
  line_.go(target_, due_);
  streams_ = regular_ && !LineDemand::jumps(axis, (line_.rate() - before) / axis.cycle_s);
  bridge_ = streams_ ? bridging_rate(before, line_.rate()) : 0.0;
}

// The axis continued while the follower waited for a late target.
void SetPointFollower::await_late_target(const Axis& axis) {
  bridging_ = !bridging_ && bridge_ != 0.0;
  streams_ = bridging_;
  if (!bridging_) return;
  line_.run_at(bridge_);
  due_ += period_.cycles(axis);
}

void SetPointFollower::step(Axis& axis) {
  keep_to_limits(axis);
  if (!following_) return await_target(axis);
  const bool streamed = streams_;
  if (streamed && due_ <= -jitter) await_late_target(axis);
  if (streams_ && line_.ends_in_next_cycle() && runs_beyond_limits(axis, line_)) streams_ = false;
  if (streamed && !streams_) end_bridge(axis, line_, demand_, target_, period_.cycles(axis));
  due_ -= 1.0;
  sync_due_ -= 1.0;
  demand_.follow(axis, line_, [&] {
    line_.step(streams_);
    return streams_ || !line_.arrived();
  });
}

}  // namespace servodrome::drive
