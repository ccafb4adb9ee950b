#include "drive/modes/cyclic_modes.hpp"

#include "drive/power/power_state.hpp"

namespace servodrome::drive {

std::uint32_t interpolation_cycles(const Axis& axis) {
  const double period_s = axis.objects.interpolation_time_period_value *
                          std::pow(10.0, static_cast<double>(axis.objects.interpolation_time_index));
  const double cycles = period_s / axis.cycle_s;
  return cycles < 1.0 ? 1 : cycles > 1e6 ? 1000000 : static_cast<std::uint32_t>(cycles + 0.5);
}

namespace {

// Demand of the loops from a line; the generator is kept at the same place so that a stop or another mode goes on from
// here.
void follow_line(Axis& axis, const Line& line) {
  const double velocity = line.arrived() && line.rate() == 0.0 ? 0.0 : line.rate() / axis.cycle_s;
  axis.generator.place(line.now(), line.fraction(), velocity);
  axis.follow_generator(Loop::position);
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
  quiet_cycles_ = 0;
  following_ = false;
  axis.new_set_point = false;
}

void CyclicSyncPosition::step(Axis& axis) {
  const Objects& objects = axis.objects;
  if (objects.interpolation_time_period_value == 0) axis.raise(Cause::interpolation_period_zero);
  ++quiet_cycles_;
  std::int64_t user = std::int64_t{objects.target_position} + objects.position_offset;
  // A SYNC takes over a changed offset; without anything new it leaves the line alone.
  if (axis.new_set_point || (axis.synchronised && following_ && user != given_)) {
    if (!following_) line_.stand(axis.generator.position(), axis.generator.fraction());
    following_ = true;
    given_ = user;
    axis.limited = false;
    if (axis.software_limits_active()) {
      const std::int64_t clipped =
          std::clamp<std::int64_t>(user, objects.min_position_limit, objects.max_position_limit);
      if (clipped != user && axis.policy.out_of_limits == OutOfLimits::fault) axis.raise(Cause::position_limit);
      axis.limited = clipped != user;
      user = clipped;
    }
    if (const std::int64_t range = axis.position_range(); range != 0) {
      // On a rotary axis the nearer of the two ways: a cyclic target never asks for half a turn in one cycle.
      const std::int64_t now = axis.units.to_user(line_.target());
      std::int64_t distance = (user - now) % range;
      if (distance > range / 2) distance -= range;
      if (distance < -(range / 2)) distance += range;
      user = now + distance;
    }
    line_.go(axis.units.to_counts(user), interpolation_cycles(axis));
    quiet_cycles_ = 0;
  } else if (line_.arrived() && quiet_cycles_ > interpolation_cycles(axis)) {
    line_.stand(line_.target());  // the master sends no more: stand at its last target
  }
  axis.new_set_point = false;
  if (following_) {
    line_.step();
    follow_line(axis, line_);
  } else {
    await_target(axis);
  }
  axis.demand.velocity += static_cast<float>(axis.units.velocity_to_counts(objects.velocity_offset));
  axis.demand.torque = static_cast<float>(objects.torque_offset) * (axis.units.velocity_inverted ? -0.001F : 0.001F);
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
  const double allowed = axis.max_velocity(true);
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
  quiet_cycles_ = 0;
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
  ++quiet_cycles_;
  if (enabled_ && (line_.arrived() || !following_) && count_ > 0) {
    if (!following_) line_.stand(axis.generator.position(), axis.generator.fraction());
    following_ = true;
    std::int64_t user = buffer_[head_];
    head_ = (head_ + 1) % capacity;
    --count_;
    axis.limited = false;
    if (axis.software_limits_active()) {
      const std::int64_t clipped =
          std::clamp<std::int64_t>(user, axis.objects.min_position_limit, axis.objects.max_position_limit);
      if (clipped != user && axis.policy.out_of_limits == OutOfLimits::fault) axis.raise(Cause::position_limit);
      axis.limited = clipped != user;
      user = clipped;
    }
    line_.go(axis.units.to_counts(user), interpolation_cycles(axis));
    quiet_cycles_ = 0;
  } else if (line_.arrived() && quiet_cycles_ > interpolation_cycles(axis)) {
    line_.stand(line_.target());
  }
  if (following_) {
    line_.step();
    follow_line(axis, line_);
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
