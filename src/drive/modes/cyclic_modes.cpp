#include "drive/modes/cyclic_modes.hpp"

#include "drive/power/power_state.hpp"

namespace servodrome::drive {

void InterpolationPeriod::update(const Axis& axis) {
  value_ = axis.objects.interpolation_time_period_value;
  index_ = axis.objects.interpolation_time_index;
  double scale = 1.0;  // powers of ten are exact as far as they matter
  for (int n = std::abs(int{index_}); n > 0; --n) scale *= 10.0;
  const double cycles = value_ * (1000.0 * axis.cycles_per_ms);
  cycles_ = std::clamp(index_ < 0 ? cycles / scale : cycles * scale, 1.0, 1e6);
}

namespace {

// How early or late a cyclic target may be, in cycles. A target is on time in the first cycle at or after it is due.
constexpr double jitter = 1.0;
bool too_late(double due) { return std::ceil(due) < -jitter; }
// Of the mean time of the targets: how far it may be off, in cycles (a period that is no multiple of the cycle makes up
// to a half), and what one target counts for it.
constexpr double phase_slack = 0.6;
constexpr double phase_share = 1.0 / 32.0;

// Demand of the loops from a line; the generator is kept at the same place so that a stop or another mode goes on from
// here.
void follow_line(Axis& axis, const Line& line, bool moving) {
  axis.generator.place(line.now(), line.fraction(), moving ? line.rate() / axis.cycle_s : 0.0);
  axis.follow_generator(Loop::position);
}

// The counts of a target in user units, for an axis that was sent to `last` before.
Counts resolve_target(Axis& axis, std::int64_t user, Counts last) {
  axis.limited = false;
  const bool limits = axis.software_limits_active();
  if (limits) {
    const std::int64_t clipped =
        std::clamp<std::int64_t>(user, axis.objects.min_position_limit, axis.objects.max_position_limit);
    if (clipped != user && axis.policy.out_of_limits == OutOfLimits::fault) axis.raise(Cause::position_limit);
    axis.limited = clipped != user;
    user = clipped;
  }
  // A cyclic target never asks for half a turn in one cycle: the nearer of the two ways round the range 607Bh, or round
  // the 32 bits of the object.
  const std::int64_t now = axis.units.to_user(last);
  if (const std::int64_t range = axis.position_range(); range != 0) {
    std::int64_t distance = (user - now) % range;
    if (distance > range / 2) distance -= range;
    if (distance < -(range / 2)) distance += range;
    user = now + distance;
  } else if (!limits) {
    user = now + wrap_to_32_bits(user - now);
  }
  return axis.units.to_counts(user);
}

// Before the first target of a mode just entered the axis comes to rest from whatever it was doing.
void await_target(Axis& axis) {
  axis.generator.step(axis.cycle_s);
  axis.follow_generator(Loop::position);
}

}  // namespace

// --- Cyclic synchronous position

void CyclicSyncPosition::enter(Axis& axis) {
  axis.come_to_rest(RampShape::linear);
  following_ = false;
  axis.new_set_point = false;
}

void CyclicSyncPosition::step(Axis& axis) {
  const Objects& objects = axis.objects;
  if (objects.interpolation_time_period_value == 0) axis.raise(Cause::interpolation_period_zero);
  const std::int64_t user = std::int64_t{objects.target_position} + objects.position_offset;
  // A SYNC takes over a changed offset; without anything new it leaves the line alone.
  if (axis.new_set_point || (axis.synchronised && following_ && user != given_)) {
    given_ = user;
    follow(axis, user);
  }
  axis.new_set_point = false;
  if (!following_) {
    await_target(axis);
  } else {
    const bool last_chance = std::ceil(due_) <= -jitter;
    if (last_chance && regular_) {
      // The next target is lost. The axis ran on for the time it might have been late; back to the last one.
      regular_ = false;
      line_.go(line_.target(), period_.cycles(axis));
    }
    const bool run_on = regular_ && !last_chance;
    line_.step(run_on);
    due_ -= 1.0;
    follow_line(axis, line_, run_on || !line_.arrived());
  }
  axis.demand.velocity += static_cast<float>(axis.units.velocity_to_counts(objects.velocity_offset));
  axis.demand.torque = static_cast<float>(objects.torque_offset) * (axis.units.velocity_inverted ? -0.001F : 0.001F);
}

void CyclicSyncPosition::follow(Axis& axis, std::int64_t user) {
  const double period = period_.cycles(axis);
  if (!following_) {
    line_.stand(axis.generator.position(), axis.generator.fraction());
    following_ = true;
    due_ = -2.0 * jitter;  // that is, not at all
  }
  if (too_late(due_)) {  // the first after a pause: due one period from now
    regular_ = false;
    due_ = period;
    phase_ = 0.0;
  } else {  // due one period after the one before
    regular_ = true;
    due_ = std::min(due_, 2.0 * jitter);
    // The master's clock is not this one. Targets that are always early or late pull the time base along.
    phase_ += (due_ - phase_) * phase_share;
    if (std::abs(phase_) > phase_slack) due_ -= phase_ * phase_share;
    due_ = std::max(1.0, due_ + period);
  }
  line_.go(resolve_target(axis, user, line_.target()), due_);
}

std::uint16_t CyclicSyncPosition::status(const Axis& axis) const {
  std::uint16_t bits = statusword::mode_bit_12;  // drive follows the command value
  if (axis.following_error) bits |= statusword::mode_bit_13;
  return bits;
}

// --- Cyclic synchronous velocity

void CyclicSyncVelocity::step(Axis& axis) {
  const Objects& objects = axis.objects;
  const double wanted =
      axis.units.velocity_to_counts(static_cast<double>(objects.target_velocity) + objects.velocity_offset);
  const double allowed = axis.max_velocity(false);
  const double target = std::clamp(wanted, -allowed, allowed);
  axis.limited = target != wanted;
  axis.generator.start_from(axis.position(), target);
  axis.demand.loop = loop;
  axis.demand.velocity = static_cast<float>(target);
  axis.demand.acceleration = 0.0F;
  axis.demand.torque = static_cast<float>(objects.torque_offset) * (axis.units.velocity_inverted ? -0.001F : 0.001F);
}

std::uint16_t CyclicSyncVelocity::status(const Axis&) const { return statusword::mode_bit_12; }

// --- Cyclic synchronous torque

void CyclicSyncTorque::step(Axis& axis) {
  const Objects& objects = axis.objects;
  const float torque = static_cast<float>(objects.target_torque + objects.torque_offset) * 0.001F;
  axis.generator.start_from(axis.position(), axis.velocity());
  axis.demand.loop = loop;
  axis.demand.torque = axis.units.velocity_inverted ? -torque : torque;
}

std::uint16_t CyclicSyncTorque::status(const Axis&) const { return statusword::mode_bit_12; }

// --- Interpolated position

void InterpolatedPosition::enter(Axis& axis) {
  axis.come_to_rest(RampShape::linear);
  following_ = false;
  count_ = 0;
  enabled_ = (axis.objects.controlword & controlword::mode_bit_4) != 0;
}

void InterpolatedPosition::controlword(Axis&, std::uint16_t, std::uint16_t now) {
  const bool enable = (now & controlword::mode_bit_4) != 0;
  enabled_ = enable;
}

void InterpolatedPosition::data_record(Axis& axis) {
  // Buffer organisation 60C4h sub 3: 0 = FIFO, a full one refuses the newest record; 1 = ring, the oldest is lost.
  const std::size_t size = std::clamp<std::size_t>(axis.objects.interpolation_actual_buffer_size, 1, capacity);
  if (count_ >= size) {
    if (axis.objects.interpolation_buffer_organisation == 0) return;
    head_ = (head_ + 1) % capacity;
    --count_;
  }
  buffer_[(head_ + count_++) % capacity] = axis.objects.interpolation_data_record;
}

void InterpolatedPosition::step(Axis& axis) {
  if (axis.objects.interpolation_time_period_value == 0) axis.raise(Cause::interpolation_period_zero);
  if (enabled_ && count_ > 0 && (!following_ || line_.ends_in_next_cycle())) {
    if (!following_) line_.stand(axis.generator.position(), axis.generator.fraction());
    const std::int64_t user = buffer_[head_];
    head_ = (head_ + 1) % capacity;
    --count_;
    const Counts target = resolve_target(axis, user, line_.target());
    const double period = period_.cycles(axis);
    following_ ? line_.chain(target, period) : line_.go(target, period);
    regular_ = following_ && !waited_;
    following_ = true;
    waited_ = false;
  } else if (line_.arrived()) {
    waited_ = true;
  }
  if (following_) {
    line_.step();
    // At the very end of a line the axis goes on when the next record is there or, in a stream, expected this instant.
    follow_line(axis, line_, !line_.arrived() || (!waited_ && (regular_ || count_ > 0)));
  } else {
    await_target(axis);
  }
}

std::uint16_t InterpolatedPosition::status(const Axis& axis) const {
  std::uint16_t bits = 0;
  if ((following_ ? line_.arrived() : axis.generator.standing()) && count_ == 0) bits |= statusword::target_reached;
  if (enabled_) bits |= statusword::mode_bit_12;  // ip mode active
  if (axis.following_error) bits |= statusword::mode_bit_13;
  return bits;
}

}  // namespace servodrome::drive
