#pragma once

#include <cstddef>
#include <cstdint>

#include "drive/hardware.hpp"
#include "drive/loops/filters.hpp"
#include "drive/loops/gains.hpp"
#include "drive/loops/motor_data.hpp"
#include "drive/transforms.hpp"
#include "drive/units.hpp"

// The control cascade of a servo drive: position, velocity and field-oriented current loop.
namespace servodrome::drive {

enum class Loop : std::uint8_t { off, torque, velocity, position };

// What the mode of operation asks for, set once per position-loop cycle and held until the next.
// Torques are fractions of the motor's rated torque; velocities counts/s.
struct LoopDemand {
  Loop loop = Loop::off;
  Counts position = 0;
  float position_fraction = 0.0F;  // [0, 1) of a count, added to `position`
  float velocity = 0.0F;           // the reference of the velocity loop; feed-forward of the position loop
  float acceleration = 0.0F;       // counts/s^2: becomes torque by the motor data's inertia (not in the torque loop)
  float torque = 0.0F;             // the reference of the torque loop; feed-forward of the others
  float torque_limit_positive = 0.0F;  // >= 0
  float torque_limit_negative = 0.0F;  // >= 0
  // >= 0. Position and velocity loop clip the velocity reference to it. The torque loop takes torque back, and brakes,
  // so that the axis does not run faster.
  float velocity_limit_positive = 0.0F;
  float velocity_limit_negative = 0.0F;
};

struct CascadeState {
  float velocity_counts_per_s = 0.0F;            // measured, filtered; exactly 0 at standstill
  float velocity_reference_counts_per_s = 0.0F;  // after the clip
  float torque_reference = 0.0F;                 // fraction of rated, after limits and filters
  float torque = 0.0F;                           // fraction of rated, from the measured currents
  float current_d_a = 0.0F;                      // measured, amplitude
  float current_q_a = 0.0F;
  Counts following_error_counts = 0;  // position demand minus actual position; 0 out of the position loop
  bool torque_limited = false;
  bool velocity_limited = false;  // the velocity reference is clipped, or the torque loop's speed limiter acts
  bool voltage_limited = false;   // the DC link does not give the voltage the current loop asks for
};

// Rest rule: while the position demand stands (same position, no velocity feed-forward) a position error of up to
// Gains::rest_window_counts counts as none, so that neither a resolution of one count nor the integrator against
// friction keeps the axis hunting. The velocity is measured between the edges of counts, not between counts, so that an
// axis standing on an edge does not seem to move.
class Cascade {
 public:
  // Takes the data over and keeps the loops' state: gains may change while the axis moves. A change of `rates`
  // restarts the cycle. `motor` and `gains` must be positive where they divide (resistance, inductances, torque
  // constant, rated torque, counts per revolution 1 .. 2^24).
  void configure(const MotorData& motor, const Gains& gains, Rates rates);

  // Clears all controllers; the measured velocity carries on if tick() was called before, so that a turning axis may be
  // enabled. The cycle restarts: the next tick runs all three loops.
  void enable(const Feedback& feedback);
  void disable();
  bool enabled() const { return enabled_; }

  void set_demand(const LoopDemand& demand);
  const LoopDemand& demand() const { return demand_; }

  // Whether the next tick runs the position loop: the time to call set_demand.
  bool position_loop_due() const { return (tick_ & position_mask_) == 0; }

  // Once per base tick, also while disabled (the measurements go on). Writes actuation.phase_voltage_v and nothing
  // else: zero unless enabled with a loop other than off.
  void tick(const Feedback& feedback, Actuation& actuation);

  const CascadeState& state() const { return state_; }
};

}  // namespace servodrome::drive
