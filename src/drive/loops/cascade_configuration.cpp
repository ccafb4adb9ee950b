// How the cascade adopts motor data, gains and rates, also while the axis moves. `tick` calls nothing in this file.
#include <algorithm>
#include <cmath>
#include <limits>

#include "drive/loops/cascade.hpp"
#include "drive/loops/constants.hpp"
#include "drive/loops/limits.hpp"

namespace servodrome::drive {
namespace {

// Rest rule: the axis is at rest if its encoder has not counted for this time. If it rests beside its target, the
// torque rises by the rated torque in push_s.
constexpr float standstill_s = 5.0e-3F;
constexpr float push_s = 1.0F;

// The speed limiter of the torque loop. `limiter_hz`: bandwidth of the limiter, on the bare rotor, with its lowest
// gain. The gain is lower if the velocity is measured late. With this gain the limiter acts only near the limit, even
// with a soft velocity loop. `limiter_share`: integral gain as a fraction of velocity_ki. It is low, so that the
// integral is still small when the axis reaches the limit, and the speed hardly overshoots.
constexpr float limiter_hz = 100.0F;
constexpr float limiter_share = 0.25F;
constexpr float load_hz = 50.0F;  // filter of the load torque that a demand from the shaft begins with

// Second-order velocity feedback: maximally flat (Butterworth).
constexpr float velocity_low_pass_damping = 0.70710678F;

// When gains change, the step that they would cause in the torque fades with this time constant.
constexpr float handover_s = 5.0e-3F;
// An integral with a longer time constant is too slow to correct a wrong load torque while the axis stops.
constexpr float slow_integral_s = 0.1F;
// Limit of the torque that fades after a change of gains, as a fraction of rated torque: while an axis oscillates, its
// torque at one moment can be high.
constexpr float most_handover = 0.3F;

constexpr float rounding_margin = 1.001F;  // of the quick check whether the voltage is too low for a braking current

}  // namespace

void Cascade::configure(const MotorData& motor, const Gains& gains, Rates rates) {
  const auto counts = static_cast<float>(motor.counts_per_revolution);
  const auto pole_pairs = static_cast<float>(motor.pole_pairs);
  two_phases_ = motor.phases == 2;
  voltage_share_ = two_phases_ ? voltage_share(2) : voltage_share(3);
  rests_ = false;
  const bool controlling = enabled_ && (demand_.loop == Loop::velocity || demand_.loop == Loop::position);
  const float proportional_before = controlling ? proportional_torque() : 0.0F;
  // With reversed phases the electrical angle and the torque of a q current have the opposite sign of the counts.
  const float sense = motor.phase_order_reversed ? -1.0F : 1.0F;
  sense_ = sense;
  const float velocity_period_s = static_cast<float>(rates.velocity_loop_ticks) * tick_s;
  velocity_mask_ = rates.velocity_loop_ticks - 1U;
  position_mask_ = rates.position_loop_ticks - 1U;
  per_position_cycle_ = 1.0F / static_cast<float>(rates.position_loop_ticks);
  velocity_periods_per_s_ = 1.0F / velocity_period_s;

  phase_scale_ = (std::uint64_t{motor.pole_pairs} << 48) / motor.counts_per_revolution;
  if (motor.phase_order_reversed) phase_scale_ = 0 - phase_scale_;
  commutation_phase_ = phase_of(motor.commutation_offset_turns);
  flux_linkage_vs_ = motor.torque_constant_nm_per_a / (phase_factor(motor.phases) * pole_pairs);
  electrical_rad_per_count_ = sense * 2.0F * pi * pole_pairs / counts;
  const float middle_ticks = 0.5F + static_cast<float>(motor.voltage_delay_ticks);
  ahead_rad_ = sense * middle_ticks * tick_s * pole_pairs / counts * 2.0F * pi;

  // The winding, v held for a tick: i' = a i + (1 - a) v / R, a = exp(-R T / L). With the zero of the PI on a, the
  // closed loop is i' = p i + (1 - p) reference, p = exp(-bandwidth T): a first order without overshoot.
  const float pole = std::exp(-2.0F * pi * gains.current_bandwidth_hz * tick_s);
  const auto place = [&](CurrentController& controller, float inductance_h) {
    controller.back_calculation = -std::expm1(-motor.resistance_ohm * tick_s / inductance_h);
    controller.kp = (1.0F - pole) * motor.resistance_ohm / controller.back_calculation;
    controller.ki = controller.kp * controller.back_calculation;
    controller.inductance_h = inductance_h;
  };
  place(direct_, motor.inductance_d_h);
  place(quadrature_, motor.inductance_q_h);

  const float torque_per_ampere = motor.torque_constant_nm_per_a / motor.rated_torque_nm;
  torque_per_ampere_ = sense * torque_per_ampere;
  ampere_per_torque_ = 1.0F / torque_per_ampere_;
  peak_torque_ = motor.peak_current_a * torque_per_ampere;
  peak_current_a_ = motor.peak_current_a;
  field_weakening_a_ = std::min(gains.field_weakening_a, motor.peak_current_a);
  direct_reference_a_ = std::max(direct_reference_a_, -field_weakening_a_);
  const float peak_flux_vs = motor.inductance_q_h * motor.peak_current_a;
  braking_v_per_rad_s_ = std::sqrt(flux_linkage_vs_ * flux_linkage_vs_ + peak_flux_vs * peak_flux_vs) *
                         rounding_margin / (braking_voltage_share * voltage_share_);
  const float rad_per_count = 2.0F * pi / counts;
  velocity_kp_ = gains.velocity_kp * torque_per_ampere * rad_per_count;
  velocity_ki_ = gains.velocity_ki * torque_per_ampere * rad_per_count * velocity_period_s;
  slow_integral_ = velocity_ki_ * velocity_periods_per_s_ * slow_integral_s < velocity_kp_;
  setpoint_weight_ = gains.velocity_setpoint_weight;
  const float rotor_torque = motor.inertia_kgm2 / motor.rated_torque_nm * rad_per_count;  // per counts/s^2
  inertia_torque_ = rotor_torque * gains.acceleration_feed_forward;
  position_kp_ = gains.position_kp;
  velocity_feed_forward_ = gains.velocity_feed_forward;
  const float position_period_s = static_cast<float>(rates.position_loop_ticks) * tick_s;
  velocity_forward_.configure(gains.velocity_feed_forward_filter_hz, position_period_s, forward_velocity_);
  acceleration_forward_.configure(gains.acceleration_feed_forward_filter_hz, position_period_s, forward_acceleration_);
  if (disturbance_share_ == 0.0F) forget_disturbance();
  disturbance_share_ = gains.disturbance_share;
  disturbance_.gain = low_pass_gain(gains.disturbance_filter_hz, velocity_period_s);
  disturbance_.inertia = rotor_torque * velocity_periods_per_s_;
  load_.gain = low_pass_gain(load_hz, position_period_s);
  load_.inertia = rotor_torque / position_period_s;
  rest_.window_counts = gains.rest_window_counts;
  rest_.still_periods = static_cast<std::uint16_t>(standstill_s * velocity_periods_per_s_);
  rest_.least_push = velocity_period_s / push_s;
  integral_limit_ = gains.velocity_integral_limit_a > 0.0F ? gains.velocity_integral_limit_a * torque_per_ampere
                                                           : std::numeric_limits<float>::max();
  handover_decay_ = velocity_period_s / handover_s;

  const bool filtered = gains.velocity_filter_hz > 0.0F;
  const VelocityFeedback feedback = filtered ? gains.velocity_feedback : VelocityFeedback::first_order;
  velocity_filter_.gain = low_pass_gain(gains.velocity_filter_hz, velocity_period_s);
  if (feedback == VelocityFeedback::second_order) {
    velocity_low_pass_ =
        make_low_pass(gains.velocity_filter_hz, velocity_low_pass_damping, velocity_period_s, velocity_low_pass_);
  } else if (feedback == VelocityFeedback::observer) {
    const float acceleration = motor.rated_torque_nm / (motor.inertia_kgm2 * rad_per_count) * velocity_period_s;
    observer_ = make_velocity_observer(gains.velocity_filter_hz, acceleration, velocity_period_s, observer_);
  }
  if (feedback != velocity_feedback_) {
    velocity_feedback_ = feedback;
    settle_velocity(state_.velocity_counts_per_s);
    observer_.disturbance = -observer_.acceleration * state_.torque;  // as if the load balanced the torque
  }
  const float filter_lags = feedback == VelocityFeedback::second_order  ? 2.0F * velocity_low_pass_damping
                            : feedback == VelocityFeedback::first_order ? 1.0F
                                                                        : 0.0F;
  const float late_s = velocity_period_s + (filtered ? filter_lags / (2.0F * pi * gains.velocity_filter_hz) : 0.0F);
  late_torque_.gain = -std::expm1(-position_period_s / late_s);
  constexpr float limiter_rad_per_s = 2.0F * pi * limiter_hz;
  limiter_kp_ = std::max(velocity_kp_, rotor_torque * limiter_rad_per_s / (1.0F + limiter_rad_per_s * late_s));
  limiter_ki_ = limiter_share * velocity_ki_;
  limiter_decay_ = std::min(limiter_ki_ / limiter_kp_, 1.0F);
  const bool command_filter_on = gains.velocity_command_filter_hz > 0.0F;
  if (command_filter_on && !command_filter_on_) command_filter_.value = state_.velocity_reference_counts_per_s;
  command_filter_on_ = command_filter_on;
  command_filter_.gain = low_pass_gain(gains.velocity_command_filter_hz, velocity_period_s);
  torque_filter_.gain = low_pass_gain(gains.torque_filter_hz, velocity_period_s);

  const std::uint8_t notch_end_before = notch_end_;
  notch_end_ = 0;
  for (std::size_t i = 0; i < notches_.size(); ++i) {
    const Notch& notch = gains.notches[i];
    if (notch.frequency_hz > 0.0F) {
      notches_[i] = make_notch(notch.frequency_hz, notch.width_hz, notch.depth, velocity_period_s, notches_[i]);
      notch_end_ = static_cast<std::uint8_t>(i + 1);
      if (i >= notch_end_before) notches_[i].settle(state_.torque_reference);
    } else {
      notches_[i] = {};
    }
  }
  if (controlling) hand_over(proportional_before);
}

float Cascade::proportional_torque() const {
  const float error = setpoint_weight_ * state_.velocity_reference_counts_per_s - state_.velocity_counts_per_s;
  return velocity_kp_ * error + feed_forward_ + compensation_;
}

// Stores the torque that the old gains gave and the new gains do not, so that it fades. The same for an integral whose
// gain is now 0, because nothing would reduce it.
void Cascade::hand_over(float proportional_before) {
  feed_forward_ = demand_.torque + forward_acceleration_ * inertia_torque_;
  compensation_ = disturbance_share_ * disturbance_.load;
  if (demand_.loop == Loop::position) {
    position_velocity_ = position_kp_ * position_error_ + velocity_feed_forward_ * forward_velocity_;
  }
  if (!command_filter_on_) {
    const float wanted = demand_.loop == Loop::position ? position_velocity_ : demand_.velocity;
    state_.velocity_reference_counts_per_s =
        clip(wanted, -demand_.velocity_limit_negative, demand_.velocity_limit_positive);
  }
  if (!slow_integral_) {
    integral_ += carried_;
    carried_ = 0.0F;
  }
  if (velocity_ki_ == 0.0F) {
    handover_ += integral_;
    integral_ = 0.0F;
  }
  handover_ += clip(proportional_before - proportional_torque(), -most_handover, most_handover);
}

}  // namespace servodrome::drive
