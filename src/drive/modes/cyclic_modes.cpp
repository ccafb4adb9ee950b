#include "drive/modes/cyclic_modes.hpp"

#include <utility>

#include "drive/power/power_state.hpp"

namespace servodrome::drive {

// --- Cyclic synchronous position

void CyclicSyncPosition::enter(Axis& axis) {
  follower_.stop();
  held_offset_ = 0;
  offset_limited_ = false;
  resume(axis);
}

// Called after a halt. The end of a halt is not a command, so an axis that a limit holds remains at the limit.
void CyclicSyncPosition::resume(Axis& axis) {
  axis.commanded.reset();
  axis.come_to_rest(RampShape::linear);
  follower_.pause();
  axis.new_set_point = false;
}

void CyclicSyncPosition::step(Axis& axis) {
  const Objects& objects = axis.objects;
  if (objects.interpolation_time_period_value == 0) axis.raise(Cause::interpolation_period_zero);
  const std::int64_t user = std::int64_t{objects.target_position} + objects.position_offset;
  // A SYNC applies a changed offset. Without a change the line continues.
  if (axis.new_set_point || (axis.synchronised && follower_.following() && user != given_)) {
    given_ = within_change(axis, user);
    follower_.follow(axis, given_);
  }
  axis.new_set_point = false;
  follower_.step(axis);
  add_velocity_offset(axis);
  axis.demand.torque = static_cast<float>(objects.torque_offset) * (axis.units.velocity_inverted ? -0.001F : 0.001F);
}

// 60B1h goes directly to the velocity loop, up to the greatest speed. It must not move the axis towards an active limit
// switch, so there it is ignored until it changes. Nor must it move the axis beyond a software limit.
void CyclicSyncPosition::add_velocity_offset(Axis& axis) {
  const double offset = axis.units.velocity_to_counts(axis.objects.velocity_offset);
  const bool at_switch = offset != 0.0 && axis.active(offset < 0.0 ? Signal::negative_limit : Signal::positive_limit);
  if (at_switch || axis.objects.velocity_offset != held_offset_)
    held_offset_ = at_switch ? axis.objects.velocity_offset : 0;
  const double added = held_offset_ != 0 ? 0.0 : offset_within_limits(axis, offset);
  const bool was_limited = std::exchange(offset_limited_, added != offset);
  if (offset_limited_ || was_limited) axis.limited = offset_limited_;
  if (added == 0.0) return;
  const double sum = static_cast<double>(axis.demand.velocity) + added;
  axis.demand.velocity = static_cast<float>(std::clamp(sum, -axis.greatest_velocity, axis.greatest_velocity));
}

// An offset moves the place at which the position loop holds the shaft by offset / kp. The offset is clipped so that
// this place is within the software limit, and that the shaft can stop there with the quick stop ramp.
double CyclicSyncPosition::offset_within_limits(const Axis& axis, double offset) {
  if (offset == 0.0 || !axis.software_limits_active()) return offset;
  const double sign = std::copysign(1.0, offset);
  const auto ahead = [sign](const Axis::Room& room) { return sign < 0.0 ? room.below : room.above; };
  const double of_demand = ahead(axis.room_from(axis.generator.nearest_position()));
  const double of_shaft = ahead(axis.room_from(axis.position()));
  const auto kp = static_cast<double>(axis.configuration.gains.position_kp);
  double most = kp > 0.0 ? kp * of_demand : std::abs(offset) + std::abs(static_cast<double>(axis.demand.velocity));
  if (const double quick = axis.quick_stop_ramp(); quick > 0.0)
    most = std::min(most, std::sqrt(2.0 * quick * std::max(0.0, of_shaft)) + kp * (of_demand - of_shaft));
  most -= sign * static_cast<double>(axis.demand.velocity);
  return sign * std::clamp(most, 0.0, std::abs(offset));
}

// For products that limit the change from one target to the next.
std::int64_t CyclicSyncPosition::within_change(Axis& axis, std::int64_t user) const {
  const Configuration::PositionChange& limits = axis.configuration.position_change;
  if (!limits.limited || limits.least > limits.greatest) return user;
  const std::int64_t base = follower_.following() ? given_ : axis.units.to_user(axis.generator.nearest_position());
  const std::int64_t change = wrap_to_32_bits(user - base);
  // A change of 0 is always allowed, so that the limits never move the axis.
  const std::int64_t allowed =
      std::clamp<std::int64_t>(change, std::min(limits.least, 0), std::max(limits.greatest, 0));
  axis.position_change_clipped = allowed != change;
  return base + allowed;
}

std::uint16_t CyclicSyncPosition::status(const Axis& axis) const {
  // Drive follows the command value: 0 while it catches up with it, and while a limit holds it.
  std::uint16_t bits = follower_.on_line() ? statusword::mode_bit_12 : std::uint16_t{0};
  if (axis.policy.status.cyclic_modes_show_reached && axis.generator.standing()) {
    const std::int64_t error = axis.units.to_user(axis.loops->following_error_counts);
    if ((error < 0 ? -error : error) <= axis.objects.position_window) bits |= statusword::target_reached;
  }
  if (axis.following_error) bits |= statusword::mode_bit_13;
  return bits;
}

// --- Cyclic synchronous velocity

double CyclicSyncVelocity::target(const Axis& axis) {
  const Objects& objects = axis.objects;
  return axis.units.velocity_to_counts(static_cast<double>(objects.target_velocity) + objects.velocity_offset);
}

void CyclicSyncVelocity::step(Axis& axis) {
  const Objects& objects = axis.objects;
  const double wanted = target(axis);
  const double allowed = axis.greatest_velocity;
  held_ = held_ && wanted == wanted_;
  wanted_ = wanted;
  const double velocity = held_ ? 0.0 : std::clamp(wanted, -allowed, allowed);
  axis.limited = velocity != wanted;
  if (axis.limited && !held_) axis.exceed_velocity(Mode::cyclic_sync_velocity);
  axis.generator.start_from(axis.position(), velocity);
  axis.demand.loop = loop;
  axis.demand.velocity = static_cast<float>(velocity);
  axis.demand.acceleration = 0.0F;
  axis.demand.torque = static_cast<float>(objects.torque_offset) * (axis.units.velocity_inverted ? -0.001F : 0.001F);
}

std::uint16_t CyclicSyncVelocity::status(const Axis& axis) const {
  // Drive follows the command value: 0 while a limit holds it.
  std::uint16_t bits = held_ ? std::uint16_t{0} : statusword::mode_bit_12;
  const double error = std::abs(axis.shown_velocity() - (held_ ? wanted_ : axis.generator.velocity()));
  if (axis.policy.status.cyclic_modes_show_reached && error < axis.configuration.speed_windows.reached_counts_per_s) {
    bits |= statusword::target_reached;
  }
  return bits;
}

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
  stop();
  given_up_ = false;
  clear_buffer();
  enabled_ = (axis.controlword & controlword::mode_bit_4) != 0;
}

void InterpolatedPosition::stop() {
  following_ = bridging_ = false;
  demand_.stop();
}

void InterpolatedPosition::interrupt(Axis&, int direction) {
  stop();
  demand_.hold(direction);
}

void InterpolatedPosition::controlword(Axis&, std::uint16_t, std::uint16_t now) {
  const bool enable = (now & controlword::mode_bit_4) != 0;
  if (enabled_ && !enable) given_up_ = true;
  enabled_ = enable;
}

std::size_t InterpolatedPosition::buffer_size(const Axis& axis) {
  return std::clamp<std::size_t>(axis.objects.interpolation_actual_buffer_size, 1, capacity);
}

// Buffer organisation 60C4h sub 3: 0 = FIFO, a full buffer refuses the new record; 1 = ring, a full buffer drops the
// oldest record.
bool InterpolatedPosition::takes_record(const Axis& axis, std::int32_t record) {
  if (axis.objects.interpolation_buffer_organisation != 0 || count_ < buffer_size(axis)) return true;
  // A record that process data only repeat is not lost.
  if (buffer_[(head_ + count_ - 1) % capacity] != record) lost_record_ = true;
  return false;
}

void InterpolatedPosition::data_record(Axis& axis) {
  if (count_ >= buffer_size(axis)) {
    head_ = (head_ + 1) % capacity;
    --count_;
  }
  buffer_[(head_ + count_++) % capacity] = axis.objects.interpolation_data_record;
  record_age_ = 0.0;
}

// Begins the line from the axis' position to the next record.
void InterpolatedPosition::take_record(Axis& axis) {
  const std::int64_t user = buffer_[head_];
  head_ = (head_ + 1) % capacity;
  --count_;
  if (!following_) target_ = axis.generator.nearest_position();
  const Counts target = resolve_cyclic_target(axis, user, target_);
  const double period = period_.cycles(axis);
  const double before = line_.rate();
  if (!following_) {
    demand_.begin(axis, line_, target, period);
    line_.go(target, period);
  } else if (!line_.ends_in_next_cycle()) {
    // If a bridge runs, this is the missing record: the axis reaches it in the time that was left, plus a small share
    // of the period for the records after it. If the axis is already returning after a bridge, the record counts as
    // the first one after a pause.
    line_.go(target, bridging_ ? line_.remaining() + late_share * (period - line_.remaining()) : period);
  } else {
    line_.chain(target, period);
  }
  regular_ = following_ && !waited_;
  const bool jumps = LineDemand::jumps(axis, (line_.rate() - before) / axis.cycle_s);
  bridge_ = regular_ && !jumps ? bridging_rate(before, line_.rate()) : 0.0;
  target_ = target;
  following_ = true;
  waited_ = bridging_ = false;
}

// The line has ended without a next record. If records arrive one at a time, the axis continues for one period in place
// of the missing record. If all records of a buffer were used, the motion ends.
void InterpolatedPosition::await_record(Axis& axis) {
  const double period = period_.cycles(axis);
  const bool one_at_a_time = record_age_ < 1.5 * period + 1.0;
  if (enabled_ && bridge_ != 0.0 && one_at_a_time && !bridging_ && line_.ends_in_next_cycle()) {
    bridging_ = true;
    line_.chain(line_.target() + std::llround(bridge_ * period), period);
  }
  if (bridging_ && (!enabled_ || line_.arrived() || runs_beyond_limits(axis, line_))) {
    bridging_ = false;
    waited_ = true;
    bridge_ = 0.0;
    end_bridge(axis, line_, demand_, target_, period);
  }
}

void InterpolatedPosition::step(Axis& axis) {
  if (axis.objects.interpolation_time_period_value == 0) axis.raise(Cause::interpolation_period_zero);
  record_age_ += 1.0;
  if (std::exchange(given_up_, false)) {  // done here, so that a halt or another stop keeps its own ramp
    stop();
    axis.come_to_rest(RampShape::linear);
  }
  if (following_ && given_up_at_limits(axis, target_)) stop();
  const bool late = waited_ || (bridging_ && line_.remaining() >= 0.5 * period_.cycles(axis));
  if (enabled_ && count_ > 0 && (!following_ || late || line_.ends_in_next_cycle())) {
    take_record(axis);
  } else {
    if (following_ && count_ == 0) await_record(axis);
    if (line_.arrived()) waited_ = true;
  }
  if (following_) {
    // At the end of a line the axis runs on if the next record is there or, in a stream, due now.
    demand_.follow(axis, line_, [&] {
      line_.step();
      return !line_.arrived() || (!waited_ && (regular_ || count_ > 0));
    });
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

// --- Interpolated position without a buffer

namespace {

// How this project reads A 69 (ProNet manual, ch. 7.5.4): one SYNC period without a set-point is tolerated, the end of
// the second raises it. The slack is one base tick, within which a late SYNC still counts as in time.
constexpr double sync_slack_cycles = 0.125;
constexpr unsigned tolerated_stale_syncs = 1;

}  // namespace

void SynchronousInterpolation::enter(Axis& axis) {
  axis.come_to_rest(RampShape::linear);
  disarm();
  fresh_ = axis.new_set_point = given_up_ = false;
  enabled_ = (axis.controlword & controlword::mode_bit_4) != 0;
}

void SynchronousInterpolation::controlword(Axis&, std::uint16_t, std::uint16_t now) {
  const bool enable = (now & controlword::mode_bit_4) != 0;
  if (enable == enabled_) return;
  enabled_ = enable;
  disarm();
  if (!enable) given_up_ = true;
}

bool SynchronousInterpolation::late(const Axis& axis) {
  const double period = axis.configuration.sync_period_s > 0.0 ? axis.configuration.sync_period_s / axis.cycle_s
                                                               : follower_.period_cycles(axis);
  return stale_syncs_ > tolerated_stale_syncs ||
         waiting_cycles_ > (1.0 + tolerated_stale_syncs) * period + sync_slack_cycles;
}

void SynchronousInterpolation::follow_target(Axis& axis) {
  const bool written = axis.new_set_point;
  axis.new_set_point = false;
  if (!enabled_) return;
  if (axis.configuration.locks_to_sync) {
    if (axis.synchronised) follower_.follow_sync(axis, axis.objects.target_position, axis.sync_age);
  } else if (written) {
    follower_.follow(axis, axis.objects.target_position);
  }
}

void SynchronousInterpolation::step(Axis& axis) {
  if (axis.objects.interpolation_time_period_value == 0) axis.raise(Cause::interpolation_period_zero);
  // Done in this function, so that a halt or another stop keeps its own ramp.
  if (std::exchange(given_up_, false)) axis.come_to_rest(RampShape::linear);
  if (axis.policy.interpolation.source == Interpolation::target) {
    follow_target(axis);
  } else if (enabled_) {
    waiting_cycles_ += 1.0;
    const bool sync = axis.synchronised;
    if (sync && (fresh_ || !armed_)) {
      if (fresh_) follower_.follow_sync(axis, axis.objects.interpolation_data_record, axis.sync_age);
      fresh_ = false;
      armed_ = true;
      stale_syncs_ = 0;
      waiting_cycles_ = axis.sync_age;
    } else if (sync) {
      ++stale_syncs_;
    }
    if (armed_ && late(axis)) axis.raise(Cause::interpolation_late);
  }
  follower_.step(axis);
}

std::uint16_t SynchronousInterpolation::status(const Axis& axis) const {
  std::uint16_t bits = 0;
  if (!fresh_ && (follower_.following() ? follower_.arrived() : axis.generator.standing())) {
    bits |= statusword::target_reached;
  }
  if (enabled_) bits |= statusword::mode_bit_12;
  return bits;
}

}  // namespace servodrome::drive
