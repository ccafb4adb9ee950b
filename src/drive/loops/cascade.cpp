#include "drive/loops/cascade.hpp"

#include <algorithm>
#include <cmath>

#include "drive/loops/constants.hpp"
#include "drive/loops/limits.hpp"
#include "drive/tuning/resonance_analysis.hpp"

namespace servodrome::drive {
namespace {

// The filtered velocity of a standing encoder is set to 0 below this fraction of one count per period.
constexpr float standstill_share = 1.0e-3F;

// The torque that fades after a change of gains is dropped below this fraction of rated torque.
constexpr float handover_end = 1.0e-5F;

constexpr float quarter_pi = 0.25F * pi;

// Field weakening keeps the voltage at this share of what the DC link allows, by an integrator that has this bandwidth
// at the lowest speed that needs it.
constexpr float weakening_share = 0.95F;
constexpr float weakening_rad_per_tick = 2.0F * pi * 100.0F * tick_s;

// A braking current is at least this fraction of the peak current.
constexpr float least_braking_share = 0.1F;

// The position error saturates at this value.
constexpr Counts largest_position_error = Counts{1} << 30;

}  // namespace

void Cascade::enable(const Feedback& feedback) {
  clear_controllers();
  demand_ = {};
  if (!measuring_) {
    edge_position_ = feedback.position_counts;
    measuring_ = true;
  }
  enabled_ = true;
  rests_ = false;
}

void Cascade::disable() {
  clear_controllers();
  demand_ = {};
  enabled_ = false;
  rests_ = false;
}

void Cascade::clear_controllers() {
  locked_ = false;
  position_velocity_ = 0.0F;
  position_error_ = 0.0F;
  integral_ = 0.0F;
  handover_ = 0.0F;
  carried_ = 0.0F;
  feed_forward_ = 0.0F;
  forget_disturbance();
  current_reference_a_ = 0.0F;
  direct_reference_a_ = 0.0F;
  direct_.integral_v = 0.0F;
  quadrature_.integral_v = 0.0F;
  torque_filter_.value = 0.0F;
  command_filter_.value = state_.velocity_counts_per_s;
  rest_.leave();
  for (Biquad& notch : notches_) notch.settle(0.0F);
  state_.velocity_reference_counts_per_s = 0.0F;
  state_.torque_reference = 0.0F;
  state_.following_error_counts = 0;
  state_.torque_limited = false;
  state_.velocity_limited = false;
  state_.voltage_limited = false;
}

void Cascade::forget_disturbance() {
  disturbance_.load = compensation_ = 0.0F;
  disturbance_.velocity = state_.velocity_counts_per_s;
}

void Cascade::set_demand(const LoopDemand& demand) {
  const Loop previous = demand_.loop;
  const auto controls_velocity = [](Loop loop) { return loop == Loop::position || loop == Loop::velocity; };
  if ((demand.hands_over || demand.loop != previous) && controls_velocity(demand.loop) && controls_velocity(previous))
    (slow_integral_ ? carried_ : integral_) += demand_.torque - demand.torque;
  demand_ = demand;
  demand_.torque_limit_positive = std::min(demand.torque_limit_positive, peak_torque_);
  demand_.torque_limit_negative = std::min(demand.torque_limit_negative, peak_torque_);
  if (demand.loop != previous) acceleration_forward_.settle(demand.acceleration);
  forward_acceleration_ = acceleration_forward_.apply(demand.acceleration);
  const float feed_forward = demand.torque + forward_acceleration_ * inertia_torque_;
  feed_forward_ = feed_forward;
  load_.update(late_torque_.apply(state_.mean_torque), state_.velocity_counts_per_s);
  state_.load_torque = load_.load;
  if (demand.from_shaft) [[unlikely]]
    keep_load();
  if (demand.loop == previous) return;
  velocity_forward_.settle(demand.velocity);
  // After the torque loop, and after a direct current that held the rotor, the integral of the velocity controller
  // starts with the load's part of the torque. The part that accelerated the axis is dropped, otherwise the axis would
  // continue to accelerate. The speed limiter of the torque loop starts from 0.
  const auto has_controllers = [](Loop loop) { return loop != Loop::off && loop != Loop::locked; };
  if (!has_controllers(demand.loop) || !has_controllers(previous)) clear_controllers();
  feed_forward_ = feed_forward;
  if (previous == Loop::locked && has_controllers(demand.loop)) {
    torque_filter_.value = load_.load;
    for (Biquad& notch : notches_) notch.settle(load_.load);
  }
  if (demand.loop == Loop::torque) {
    integral_ = 0.0F;
    handover_ = 0.0F;
    carried_ = 0.0F;
  } else if (has_controllers(demand.loop) && (previous == Loop::torque || previous == Loop::locked)) {
    forget_disturbance();
    const float load = load_.load - feed_forward;
    carried_ = slow_integral_ ? load : 0.0F;
    integral_ = load - carried_;
    handover_ = 0.0F;
    command_filter_.value = state_.velocity_counts_per_s;
  }
  if (demand.loop != Loop::position) state_.following_error_counts = 0;
  rest_.leave();
  last_demand_position_ = demand.position;
  last_demand_fraction_ = demand.position_fraction;
}

// While a shaft oscillates about its demand, the integral can be far above the load torque, because the proportional
// part balances it. If the demand restarts at the shaft, the proportional part is 0, and the integral alone would drive
// the shaft. Therefore only the load's part of the integral is kept.
void Cascade::keep_load() {
  // The integral also balances the proportional part that a set-point weight below 1 causes at constant speed.
  const float even = velocity_kp_ * (1.0F - setpoint_weight_) * state_.velocity_counts_per_s;
  const float whole = load_.load - demand_.torque - compensation_;
  carried_ = clip(whole, std::min(0.0F, carried_), std::max(0.0F, carried_));
  const float load = whole - carried_;
  const float present = integral_ - even;
  integral_ = even + clip(load, std::min(0.0F, present), std::max(0.0F, present));
}

// `carried_` is the load that the torque loop held, but may in fact be torque that accelerated an unknown inertia. It
// fades while the proportional part opposes it with at least a tenth of its value. A true load is not opposed so
// strongly, and remains.
[[gnu::noinline]] void Cascade::fade_carried(float proportional) {
  constexpr float opposed_share = 0.1F;
  if (proportional * carried_ > 0.0F || std::fabs(proportional) < opposed_share * std::fabs(carried_)) return;
  carried_ -= handover_decay_ * carried_;
  if (std::fabs(carried_) < handover_end) carried_ = 0.0F;
}

template <unsigned Phases>
void Cascade::run_tick(const Feedback& feedback, Actuation& actuation) {
  const std::uint32_t tick = tick_++;
  const bool active = enabled_ && demand_.loop != Loop::off;
  if ((tick & velocity_mask_) == 0) {
    measure_velocity(feedback.position_counts);
    if (active && demand_.loop != Loop::locked) {
      if (demand_.loop == Loop::position && (tick & position_mask_) == 0) run_position_loop(feedback.position_counts);
      run_velocity_loop(feedback);
    }
  }

  const Phase phase = static_cast<Phase>((feedback.single_turn_counts * phase_scale_) >> 16) + commutation_phase_;
  if (phase != phase_) {
    phase_ = phase;
    angle_ = sin_cos(phase);
  }
  const SinCos angle = angle_;
  const DirectQuadrature current = to_rotor_frame<Phases>(current_of(feedback), angle);
  state_.current_d_a = current.d;
  state_.current_q_a = current.q * sense_;
  state_.torque = current.q * torque_per_ampere_;
  torque_sum_ += state_.torque;
  if (position_loop_due()) {
    state_.mean_torque = torque_sum_ * per_position_cycle_;
    torque_sum_ = 0.0F;
  }
  if (active && demand_.loop == Loop::locked) [[unlikely]] {
    state_.following_error_counts = demand_.position - feedback.position_counts;
    run_locked<Phases>(feedback, phase, actuation);
  } else if (active) {
    // The voltage acts for one tick, so it is rotated to the rotor angle in the middle of the tick.
    const SinCos ahead{angle.sine * ahead_.cosine + angle.cosine * ahead_.sine,
                       angle.cosine * ahead_.cosine - angle.sine * ahead_.sine};
    const DirectQuadrature reference{direct_reference_a_, quadrature_reference()};
    run_current_loop<Phases>(current, reference, electrical_rad_per_s_, ahead, feedback.dc_link_v, actuation);
  } else {
    actuation.phase_voltage_v = {};
    rests_ = !carries_current(feedback) && at_rest(feedback.position_counts);
    rest_position_ = feedback.position_counts;
  }
}

bool Cascade::at_rest(Counts position) const {
  const bool at_edge = edge_position_ == position || edge_position_ == position + 1;
  return measuring_ && at_edge && !moved_ && state_.velocity_counts_per_s == 0.0F && velocity_filter_.value == 0.0F &&
         velocity_feedback_ == VelocityFeedback::first_order && torque_sum_ == 0.0F && state_.mean_torque == 0.0F;
}

template void Cascade::run_tick<2>(const Feedback&, Actuation&);
template void Cascade::run_tick<3>(const Feedback&, Actuation&);

// The encoder shows the shaft's position to one count only, but its position at the last crossed edge is exact.
// Differences of edges therefore give the velocity without the error of one count that a change of direction, or
// standing on an edge, would cause.
void Cascade::measure_velocity(Counts position) {
  if (!measuring_) {
    edge_position_ = position;
    measuring_ = true;
  }
  const Counts edge = std::clamp(edge_position_, position, position + 1);
  const auto moved = static_cast<std::int32_t>(edge - edge_position_);
  edge_position_ = edge;
  moved_ = moved != 0;
  float velocity = filtered_velocity(static_cast<float>(moved) * velocity_periods_per_s_);
  if (moved == 0 && velocity != 0.0F && std::fabs(velocity) < standstill_share * velocity_periods_per_s_) {
    velocity = 0.0F;
    settle_velocity(0.0F);
  }
  state_.velocity_counts_per_s = velocity;
  electrical_rad_per_s_ = velocity * electrical_rad_per_count_;
  if (velocity == 0.0F) {
    ahead_ = {0.0F, 1.0F};
    return;
  }
  const float ahead_rad = velocity * ahead_rad_;
  if (std::fabs(ahead_rad) < quarter_pi) [[likely]] {
    ahead_ = sin_cos_near_zero(ahead_rad);
  } else {
    ahead_ = sin_cos(phase_of(clip(ahead_rad * (0.5F / pi), -0.25F, 0.25F)));
  }
}

float Cascade::filtered_velocity(float measured) {
  switch (velocity_feedback_) {
    case VelocityFeedback::second_order: return velocity_low_pass_.apply(measured);
    case VelocityFeedback::observer: return observer_.apply(measured, state_.torque);
    default: return velocity_filter_.apply(measured);
  }
}

void Cascade::settle_velocity(float velocity) {
  velocity_filter_.value = velocity;
  velocity_low_pass_.settle(velocity);
  observer_.velocity = velocity;
}

void Cascade::run_position_loop(Counts position) {
  const Counts error_counts = demand_.position - position;
  state_.following_error_counts = error_counts;
  float error = static_cast<float>(static_cast<std::int32_t>(
                    std::clamp(error_counts, -largest_position_error, largest_position_error))) +
                demand_.position_fraction;
  const bool standing = demand_.velocity == 0.0F && demand_.position == last_demand_position_ &&
                        demand_.position_fraction == last_demand_fraction_;
  last_demand_position_ = demand_.position;
  last_demand_fraction_ = demand_.position_fraction;
  error = rest_.position_error(error, standing);
  position_error_ = error;
  forward_velocity_ = velocity_forward_.apply(demand_.velocity);
  position_velocity_ = position_kp_ * error + velocity_feed_forward_ * forward_velocity_;
}

// While the axis rests, friction absorbs the torque, so the torque does not show the load.
void Cascade::observe_disturbance() {
  const float velocity = state_.velocity_counts_per_s;
  if (rest_.at_rest()) {
    disturbance_.velocity = velocity;
    return;
  }
  disturbance_.update(state_.torque_reference, velocity);
  compensation_ = disturbance_share_ * disturbance_.load;
}

// Limits the braking torque to what the DC link's voltage can control. A turning motor drives a braking current by
// itself, and the current loop needs voltage against it: (w L i)^2 + (w psi)^2 must stay within that of the DC link.
// Without this limit a hard stop from a high speed ends in overcurrent.
[[gnu::noinline]] void Cascade::limit_braking(float dc_link_v) {
  const float available = braking_voltage_share * voltage_share_ * dc_link_v;
  const float emf = electrical_rad_per_s_ * (flux_linkage_vs_ + direct_.inductance_h * direct_reference_a_);
  const float reactance = electrical_rad_per_s_ * quadrature_.inductance_h;
  const float peak_drop = reactance * peak_torque_ * ampere_per_torque_;
  const float room = available * available - emf * emf;
  if (room >= peak_drop * peak_drop) return;
  const float share = room > 0.0F ? std::sqrt(room) / std::fabs(peak_drop) : 0.0F;
  const float limit = peak_torque_ * std::max(share, least_braking_share);
  if (state_.velocity_counts_per_s > 0.0F) {
    torque_low_ = std::max(torque_low_, -limit);
  } else {
    torque_high_ = std::min(torque_high_, limit);
  }
}

// The direct current lowers the flux linkage until the voltage is within its limit. The integrator divides by the
// reactance, because a direct current changes the voltage by reactance times current. It uses the reactance at the
// speed at which the back-EMF alone needs the whole voltage.
[[gnu::noinline]] void Cascade::weaken_field(float wanted_v, float available_v) {
  if (available_v <= 0.0F) return;
  const float reactance_ohm = available_v / flux_linkage_vs_ * direct_.inductance_h;
  const float room_v = weakening_share * available_v - wanted_v;
  direct_reference_a_ =
      clip(direct_reference_a_ + weakening_rad_per_tick / reactance_ohm * room_v, -field_weakening_a_, 0.0F);
}

// Both currents together stay within the peak current.
float Cascade::quadrature_reference() const {
  if (direct_reference_a_ == 0.0F) [[likely]]
    return current_reference_a_;
  const float rest_a =
      std::sqrt(std::max(0.0F, peak_current_a_ * peak_current_a_ - direct_reference_a_ * direct_reference_a_));
  return clip(current_reference_a_, -rest_a, rest_a);
}

void Cascade::run_velocity_loop(const Feedback& feedback) {
  torque_low_ = -demand_.torque_limit_negative;
  torque_high_ = demand_.torque_limit_positive;
  if (std::fabs(electrical_rad_per_s_) * braking_v_per_rad_s_ > feedback.dc_link_v) [[unlikely]]
    limit_braking(feedback.dc_link_v);
  const float controlled = demand_.loop == Loop::torque ? torque_controller() : velocity_controller();
  float torque = controlled;
  if (notch_end_ != 0) {
    for (std::size_t i = 0; i < notch_end_; ++i) torque = notches_[i].apply(torque);
    torque = clip(torque, torque_low_, torque_high_);
  }
  torque = torque_filter_.apply(torque);
  if (analysis_ != nullptr) {
    torque += analysis_->exchange(
        {.position = feedback.position_counts, .controller_torque = controlled, .torque = state_.torque});
    torque = clip(torque, torque_low_, torque_high_);
  }
  state_.torque_reference = torque;
  current_reference_a_ = torque * ampere_per_torque_;
}

// PI with anti-windup: the integral stops while the error would drive the torque further into its limit, or the current
// beyond the available voltage.
float Cascade::velocity_controller() {
  const float wanted = demand_.loop == Loop::position ? position_velocity_ : demand_.velocity;
  float reference = clip(wanted, -demand_.velocity_limit_negative, demand_.velocity_limit_positive);
  if (command_filter_on_) reference = command_filter_.apply(reference);
  state_.velocity_reference_counts_per_s = reference;
  state_.velocity_limited = wanted > demand_.velocity_limit_positive || wanted < -demand_.velocity_limit_negative;

  const float low = torque_low_;
  const float high = torque_high_;
  const float measured = state_.velocity_counts_per_s;
  const float error = reference - measured;
  float sum =
      velocity_kp_ * (setpoint_weight_ * reference - measured) + integral_ + feed_forward_ + handover_ + carried_;
  if (disturbance_share_ != 0.0F) {
    observe_disturbance();
    sum += compensation_;
  }
  const float torque = clip(sum, low, high);
  state_.torque_limited = torque != sum;
  if (handover_ != 0.0F) {
    handover_ -= handover_decay_ * handover_;
    if (std::fabs(handover_) < handover_end) handover_ = 0.0F;
  }
  if (carried_ != 0.0F) [[unlikely]]
    fade_carried(velocity_kp_ * error);
  const bool winding_up = state_.torque_limited ? (sum > torque) == (error > 0.0F)
                                                : state_.voltage_limited && (error > 0.0F) == (torque > 0.0F);
  if (demand_.integral_off) {
    handover_ += integral_;
    integral_ = 0.0F;
  } else if (!winding_up) {
    integral_ = rest_.integrate(integral_, velocity_ki_ * error, moved_);
  }
  // The integral is clipped to a lowered limit, but may exceed it to compensate a wrong feed-forward.
  integral_ = clip(integral_, std::max(low - std::max(feed_forward_, 0.0F), -integral_limit_),
                   std::min(high + std::max(-feed_forward_, 0.0F), integral_limit_));
  return torque;
}

// The demanded torque, limited by two velocity controllers for the two speed limits: each reduces the torque in
// proportion to the distance from its limit. They share one integral, which finds the load at the limit and fades
// otherwise.
float Cascade::torque_controller() {
  const float low = torque_low_;
  const float high = torque_high_;
  const float wanted = clip(demand_.torque, low, high);
  state_.torque_limited = wanted != demand_.torque;

  const float room_above = demand_.velocity_limit_positive - state_.velocity_counts_per_s;
  const float room_below = -demand_.velocity_limit_negative - state_.velocity_counts_per_s;
  const float most = limiter_kp_ * room_above + integral_;
  const float least = limiter_kp_ * room_below + integral_;
  const float torque = clip(clip(wanted, least, most), low, high);
  state_.velocity_limited = wanted < least || wanted > most;
  // Anti-windup: while a torque limit holds the limiter back, its integral does not grow any further.
  if (wanted > most) {
    state_.velocity_reference_counts_per_s = demand_.velocity_limit_positive;
    if (most >= low || room_above > 0.0F) integral_ += limiter_ki_ * room_above;
  } else if (wanted < least) {
    state_.velocity_reference_counts_per_s = -demand_.velocity_limit_negative;
    if (least <= high || room_below < 0.0F) integral_ += limiter_ki_ * room_below;
  } else {
    state_.velocity_reference_counts_per_s = state_.velocity_counts_per_s;
    integral_ -= limiter_decay_ * integral_;
  }
  integral_ = clip(integral_, low, high);
  return torque;
}

// Not inlined, to save registers in the tick.
template <unsigned Phases>
[[gnu::noinline]] void Cascade::run_locked(const Feedback& feedback, Phase phase, Actuation& actuation) {
  if (!locked_) lock_phase_ = phase;
  locked_ = true;
  const SinCos angle = sin_cos(lock_phase_);
  run_current_loop<Phases>(to_rotor_frame<Phases>(current_of(feedback), angle), {demand_.lock_current_a, 0.0F}, 0.0F,
                           angle, feedback.dc_link_v, actuation);
}

template <unsigned Phases>
void Cascade::run_current_loop(DirectQuadrature current, DirectQuadrature reference, float rad_per_s, SinCos angle,
                               float dc_link_v, Actuation& actuation) {
  const float error_d = reference.d - current.d;
  const float error_q = reference.q - current.q;
  const float wanted_d = direct_.kp * error_d + (direct_.integral_v - rad_per_s * quadrature_.inductance_h * current.q);
  const float wanted_q = quadrature_.kp * error_q + (rad_per_s * direct_.inductance_h * current.d +
                                                     (quadrature_.integral_v + rad_per_s * flux_linkage_vs_));

  // Limits to a sinusoidal phase voltage that the DC link allows; d has priority, because it keeps the field's
  // orientation.
  const float available = dc_link_v * voltage_share(Phases);
  DirectQuadrature voltage{wanted_d, wanted_q};
  const float wanted_squared = wanted_d * wanted_d + wanted_q * wanted_q;
  state_.voltage_limited = wanted_squared > available * available;
  if (field_weakening_a_ != 0.0F) [[unlikely]]
    weaken_field(std::sqrt(wanted_squared), available);
  if (state_.voltage_limited) {
    voltage.d = clip(wanted_d, -available, available);
    const float rest = std::sqrt(available * available - voltage.d * voltage.d);
    voltage.q = clip(wanted_q, -rest, rest);
  }
  direct_.integral_v += direct_.ki * error_d + direct_.back_calculation * (voltage.d - wanted_d);
  quadrature_.integral_v += quadrature_.ki * error_q + quadrature_.back_calculation * (voltage.q - wanted_q);

  actuation.phase_voltage_v = to_phases<Phases>(voltage, angle);
}

void Cascade::stop_analysis() {
  if (analysis_ != nullptr) analysis_->stop();
}

}  // namespace servodrome::drive
