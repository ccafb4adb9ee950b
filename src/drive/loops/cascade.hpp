#pragma once

#include <array>
#include <cstdint>

#include "drive/hardware.hpp"
#include "drive/loops/filters.hpp"
#include "drive/loops/gains.hpp"
#include "drive/loops/motor_data.hpp"
#include "drive/loops/rest.hpp"
#include "drive/transforms.hpp"
#include "drive/units.hpp"

// The control cascade of a servo drive: position, velocity and field-oriented current loop.
namespace servodrome::drive {

class ResonanceAnalysis;

// locked: a direct current at the rotor's present angle holds the rotor, as in a stepper motor.
enum class Loop : std::uint8_t { off, torque, velocity, position, locked };

// The demand of the mode of operation, set once per position-loop cycle and held until the next. Torques are fractions
// of the motor's rated torque; velocities counts/s.
struct LoopDemand {
  Loop loop = Loop::off;
  Counts position = 0;
  float position_fraction = 0.0F;  // [0, 1) of a count, added to `position`
  float velocity = 0.0F;           // the reference of the velocity loop; feed-forward of the position loop
  float acceleration = 0.0F;       // counts/s^2: becomes torque by the motor data's inertia (not in the torque loop)
  float torque = 0.0F;             // the reference of the torque loop; feed-forward of the others
  float lock_current_a = 0.0F;     // amplitude, of the locked loop
  float torque_limit_positive = 0.0F;  // >= 0
  float torque_limit_negative = 0.0F;  // >= 0
  // >= 0. Position and velocity loop clip the velocity reference to it. The torque loop reduces the torque, or brakes,
  // to keep to it.
  float velocity_limit_positive = 0.0F;
  float velocity_limit_negative = 0.0F;
  bool integral_off = false;  // the velocity controller is proportional only
  // The demand restarts from a shaft that did not follow the demand before: the velocity controller keeps the load's
  // part of its integral only. For one position-loop cycle.
  bool from_shaft = false;
  // Another source gives the demand than in the cycle before, for example a stop instead of the mode. The velocity
  // controller takes over what the feed-forward `torque` changes by.
  bool hands_over = false;
};

struct CascadeState {
  float velocity_counts_per_s = 0.0F;            // measured, filtered; exactly 0 at standstill
  float velocity_reference_counts_per_s = 0.0F;  // after the clip
  float torque_reference = 0.0F;                 // fraction of rated, after limits and filters
  float torque = 0.0F;                           // fraction of rated, from the measured currents
  float mean_torque = 0.0F;                      // the same, mean over the last position-loop cycle
  float load_torque = 0.0F;                      // the part of it that does not accelerate the motor data's inertia
  float current_d_a = 0.0F;                      // measured, amplitude
  float current_q_a = 0.0F;                      // same sign as the torque
  Counts following_error_counts = 0;             // position demand minus actual position; 0 without a position demand
  bool torque_limited = false;
  bool velocity_limited = false;  // the velocity reference is clipped, or the torque loop's speed limiter acts
  bool voltage_limited = false;   // the DC link's voltage is too low for the current loop
};

// For the axis at rest see RestRule. The velocity is measured between edges of counts, so that an axis that stands on
// an edge shows no velocity.
class Cascade {
 public:
  // Adopts the data and keeps the state of the loops: gains may change while the axis moves. The torque has no step:
  // the difference that the new gains cause fades over about 15 ms. `motor` and `gains` must be positive where they
  // divide (resistance, inductances, torque constant, rated torque, current bandwidth, counts per revolution 1 ..
  // 2^24).
  void configure(const MotorData& motor, const Gains& gains, Rates rates);

  // Clears the controllers and the demand (Loop::off until set_demand). The measured velocity and the cycle carry on if
  // tick() was called before, so that a turning axis may be enabled.
  void enable(const Feedback& feedback);
  void disable();
  bool enabled() const { return enabled_; }
  // Call this when the encoder's position was set to another value: it discards the measured velocity.
  void forget_motion() {
    measuring_ = false;
    rests_ = false;
    settle_velocity(0.0F);
    state_.velocity_counts_per_s = 0.0F;
  }

  // The offsets of the current sensors, which tick() subtracts from the readings of the sensors.
  void set_current_offset(const std::array<float, 3>& offset_a) { current_offset_a_ = offset_a; }
  std::array<float, 3> current_of(const Feedback& feedback) const {
    const auto& [u, v, w] = feedback.phase_current_a;
    return {u - current_offset_a_[0], v - current_offset_a_[1], w - current_offset_a_[2]};
  }

  // Adds the excitation of the analysis to the torque and passes the response to it, once per velocity period, while
  // the velocity loop runs. nullptr: ends that.
  void set_analysis(ResonanceAnalysis* analysis) { analysis_ = analysis; }
  void stop_analysis();

  void set_demand(const LoopDemand& demand);
  const LoopDemand& demand() const { return demand_; }

  // Returns true if the next tick runs the position loop, so that set_demand is due.
  bool position_loop_due() const { return (tick_ & position_mask_) == 0; }
  // Ticks until then; 0: now.
  std::uint32_t ticks_to_position_loop() const { return (0u - tick_) & position_mask_; }

  // Once per base tick, also while disabled, because measuring continues. Writes only actuation.phase_voltage_v: zero
  // unless enabled with a loop other than off.
  void tick(const Feedback& feedback, Actuation& actuation) {
    if (rests_ && !enabled_ && feedback.position_counts == rest_position_ && !carries_current(feedback)) {
      ++tick_;  // the last measurement is still valid
      actuation.phase_voltage_v = {};
    } else if (two_phases_) [[unlikely]] {
      run_tick<2>(feedback, actuation);
    } else {
      run_tick<3>(feedback, actuation);
    }
  }

  const CascadeState& state() const { return state_; }
  Phase electrical_angle() const { return phase_; }  // as of the last tick
  std::uint32_t ticks() const { return tick_; }

 private:
  static bool carries_current(const Feedback& feedback) {
    const auto& [u, v, w] = feedback.phase_current_a;
    return u != 0.0F || v != 0.0F || w != 0.0F;
  }
  // Returns true if another tick at this position, without power and current, changes nothing.
  bool at_rest(Counts position) const;
  void clear_controllers();
  void measure_velocity(Counts position);
  void run_position_loop(Counts position);
  void run_velocity_loop(const Feedback& feedback);
  void limit_braking(float dc_link_v);
  void weaken_field(float wanted_v, float available_v);
  float quadrature_reference() const;
  float filtered_velocity(float measured);
  void settle_velocity(float velocity);
  // The torque of the present gains for the present errors, without the integral.
  float proportional_torque() const;
  void observe_disturbance();
  void forget_disturbance();
  void keep_load();
  void hand_over(float proportional_before);
  void fade_carried(float proportional);
  float velocity_controller();
  float torque_controller();
  template <unsigned Phases>
  void run_tick(const Feedback& feedback, Actuation& actuation);
  template <unsigned Phases>
  void run_locked(const Feedback& feedback, Phase phase, Actuation& actuation);
  // Currents are in a frame that rotates at `rad_per_s`; the voltage is applied at `angle` of that frame.
  template <unsigned Phases>
  void run_current_loop(DirectQuadrature current, DirectQuadrature reference, float rad_per_s, SinCos angle,
                        float dc_link_v, Actuation& actuation);

  // One axis of the current loop: a discrete PI whose zero cancels the winding's pole.
  struct CurrentController {
    float kp = 0.0F;                // V/A
    float ki = 0.0F;                // V/A per tick
    float back_calculation = 0.0F;  // ki / kp
    float inductance_h = 0.0F;
    float integral_v = 0.0F;
  };

  // Running state
  std::uint32_t tick_ = 0;
  bool enabled_ = false;
  bool locked_ = false;
  Phase lock_phase_ = 0;        // the electrical angle of the locked current
  bool measuring_ = false;      // edge_position_ is valid
  std::uint8_t notch_end_ = 0;  // behind the last notch that is on
  bool moved_ = false;          // the encoder counted in the last velocity period
  bool rests_ = false;          // nothing moves as long as the encoder is at rest_position_
  Counts rest_position_ = 0;
  Counts edge_position_ = 0;  // the edge of a count last crossed
  float torque_sum_ = 0.0F;   // of the measured torque in this position-loop cycle
  LowPass velocity_filter_;
  LowPass torque_filter_;
  LowPass command_filter_;  // applied only with command_filter_on_
  bool command_filter_on_ = false;
  OptionalLowPass velocity_forward_;      // of the demand's velocity, with its output
  OptionalLowPass acceleration_forward_;  // of its acceleration, with its output
  float forward_velocity_ = 0.0F;         // counts/s
  float forward_acceleration_ = 0.0F;     // counts/s^2
  VelocityFeedback velocity_feedback_ = VelocityFeedback::first_order;
  float position_velocity_ = 0.0F;  // counts/s: velocity reference out of the position loop
  float position_error_ = 0.0F;     // counts, as the position loop saw it last
  float integral_ = 0.0F;           // of the velocity loop, fraction of rated torque
  float handover_ = 0.0F;           // torque of earlier gains, which fades out
  float carried_ = 0.0F;            // load that the torque loop held, while a slow integral takes it over
  float feed_forward_ = 0.0F;       // torque, fraction of rated
  float current_reference_a_ = 0.0F;
  float direct_reference_a_ = 0.0F;  // <= 0: of the field weakening
  float electrical_rad_per_s_ = 0.0F;
  SinCos ahead_{0.0F, 1.0F};  // rotation of the rotor until the middle of the voltage's tick
  Phase phase_ = 0;           // the electrical angle, with its sine and cosine
  SinCos angle_{0.0F, 1.0F};
  std::array<float, 3> current_offset_a_{};
  CurrentController direct_;
  CurrentController quadrature_;
  CascadeState state_;
  LoopDemand demand_;
  RestRule rest_;
  Counts last_demand_position_ = 0;
  float last_demand_fraction_ = 0.0F;

  // Derived from motor data, gains and rates
  bool two_phases_ = false;
  std::uint32_t velocity_mask_ = 1;
  std::uint32_t position_mask_ = 7;
  float per_position_cycle_ = 0.125F;
  std::uint64_t phase_scale_ = 0;  // electrical turns per count, in 2^-48
  Phase commutation_phase_ = 0;
  float flux_linkage_vs_ = 0.0F;
  float sense_ = 1.0F;              // -1 with the phases reversed: angle against counts, torque against the q current
  float torque_per_ampere_ = 0.0F;  // fraction of rated per A, with its sense
  float ampere_per_torque_ = 0.0F;
  float peak_torque_ = 0.0F;  // fraction of rated at the peak current
  float torque_low_ = 0.0F;   // limits of the torque in this velocity period, fractions of rated
  float torque_high_ = 0.0F;
  float peak_current_a_ = 0.0F;
  float field_weakening_a_ = 0.0F;
  float voltage_share_ = 0.0F;  // of the DC link, amplitude of a phase
  // DC link voltage per electrical rad/s that braking with the peak current needs
  float braking_v_per_rad_s_ = 0.0F;
  float velocity_periods_per_s_ = 8000.0F;  // also: the velocity of one count per period
  float electrical_rad_per_count_ = 0.0F;
  float ahead_rad_ = 0.0F;      // electrical rad until the middle of the voltage's tick, per counts/s
  float velocity_kp_ = 0.0F;    // fraction of rated torque per counts/s
  float velocity_ki_ = 0.0F;    // fraction of rated torque per counts/s, added in each velocity period
  bool slow_integral_ = false;  // the integral of the velocity loop is slow or off
  float setpoint_weight_ = 1.0F;
  float integral_limit_ = 0.0F;  // fraction of rated torque
  float handover_decay_ = 0.0F;  // per velocity period
  float inertia_torque_ = 0.0F;  // fraction of rated torque per counts/s^2, includes its share (Gains)
  float limiter_kp_ = 0.0F;      // of the speed limiter: fraction of rated torque per counts/s
  float limiter_ki_ = 0.0F;      // of the speed limiter: fraction of rated torque per counts/s and velocity period
  float limiter_decay_ = 0.0F;   // of the speed limiter's integral, per velocity period
  float position_kp_ = 0.0F;
  float velocity_feed_forward_ = 1.0F;
  float disturbance_share_ = 0.0F;
  float compensation_ = 0.0F;  // torque against the disturbance, fraction of rated

  std::array<Biquad, most_notches> notches_{};  // the first notch_end_ are applied
  Biquad velocity_low_pass_{};                  // VelocityFeedback::second_order
  VelocityObserver observer_{};
  DisturbanceObserver disturbance_{};
  LowPass late_torque_;  // the measured torque, as late as the measured velocity
  DisturbanceObserver
      load_{};  // observes the load once per position-loop cycle, for a demand that restarts at the shaft
  ResonanceAnalysis* analysis_ = nullptr;
};

}  // namespace servodrome::drive
