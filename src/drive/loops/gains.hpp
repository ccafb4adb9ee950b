#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/loops/motor_data.hpp"

// The gains of a servo drive in physical units; a product converts them from its own units.
namespace servodrome::drive {

// How often the outer loops run, in base ticks of 62.5 us. Powers of two; the position loop is no faster than the
// velocity loop.
struct Rates {
  std::uint8_t velocity_loop_ticks = 2;  // 2: 8 kHz, 4: 4 kHz
  std::uint8_t position_loop_ticks = 8;  // 8: 2 kHz, 16: 1 kHz
  friend bool operator==(const Rates&, const Rates&) = default;
};

// A notch in the torque reference, against a mechanical resonance: (s^2 + depth B s + w^2) / (s^2 + B s + w^2).
struct Notch {
  float frequency_hz = 0.0F;  // centre, below 7/16 of the velocity loop's rate; 0: off
  float width_hz = 0.0F;      // B / 2 pi: with depth 0, the distance of the two -3 dB points
  float depth = 0.0F;         // gain at the centre, 0 (nothing passes) .. 1 (no notch)
};

inline constexpr std::size_t most_notches = 4;

// The velocity feedback of the velocity loop. If velocity_filter_hz is 0 it is the unfiltered velocity.
enum class VelocityFeedback : std::uint8_t {
  first_order,   // low pass at velocity_filter_hz
  second_order,  // the same with second order, damping 1 / sqrt 2
  observer,      // VelocityObserver with its poles at velocity_filter_hz, for the inertia of the motor data
};

struct Gains {
  float current_bandwidth_hz = 1000.0F;    // of the closed current loop; its PI follows from the motor data
  float velocity_kp = 0.0F;                // A (amplitude of the q current) per rad/s of the shaft
  float velocity_ki = 0.0F;                // A per rad
  float velocity_setpoint_weight = 1.0F;   // share of the reference in the P part: 1 PI .. 0 I-P (pseudo-differential)
  float position_kp = 0.0F;                // 1/s
  float velocity_feed_forward = 1.0F;      // share of LoopDemand::velocity in the position loop
  float acceleration_feed_forward = 1.0F;  // share of inertia times LoopDemand::acceleration
  // Corners of low passes on the demand's velocity and acceleration for the two feed-forwards; 0: off.
  float velocity_feed_forward_filter_hz = 0.0F;
  float acceleration_feed_forward_filter_hz = 0.0F;
  VelocityFeedback velocity_feedback = VelocityFeedback::first_order;
  float velocity_filter_hz = 0.0F;          // corner of the filter on the measured velocity; 0: off
  float velocity_command_filter_hz = 0.0F;  // corner of a low pass on the velocity reference; 0: off
  float velocity_integral_limit_a = 0.0F;   // limit of the integral of the velocity loop, amplitude; 0: none
  float torque_filter_hz = 0.0F;            // corner of the low pass on the torque reference; 0: off
  // Disturbance compensation: the load torque, computed from torque, velocity and the inertia of the motor data, passes
  // a low pass, and this fraction of it is added to the torque. 0: off.
  float disturbance_share = 0.0F;
  float disturbance_filter_hz = 0.0F;
  // Field weakening: greatest direct current (amplitude) against the magnet's flux, for speeds at which the DC link's
  // voltage is too low otherwise. 0: none.
  float field_weakening_a = 0.0F;
  float rest_window_counts = 1.0F;  // position errors that are ignored at rest: see RestRule
  std::array<Notch, most_notches> notches{};
};

// The bandwidths for default_gains().
struct Bandwidths {
  float current_hz = 1000.0F;  // closed loop, -3 dB
  float velocity_hz = 100.0F;  // crossover of the open velocity loop
  float position_kp = 100.0F;  // 1/s
};

// Gains for the inertia in `motor`. Current: PI that cancels the winding's pole. Velocity: PI and filters around the
// crossover, with a phase margin of 55 degrees including all delays. The crossover is lower if the delays do not allow
// it, if the filters would be above half the velocity loop's rate, or if one count of a coarse encoder would cause more
// than a tenth of the rated torque. position_kp is at most a fifth of the crossover.
Gains default_gains(const MotorData& motor, Rates rates, const Bandwidths& bandwidths);

}  // namespace servodrome::drive
