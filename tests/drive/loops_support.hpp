#pragma once

#include <cmath>
#include <numbers>

#include "drive/loops/cascade.hpp"
#include "plant/plant.hpp"

// A cascade with a simulated motor, in closed loop and virtual time.
namespace servodrome::drive::test {

inline constexpr double pi = std::numbers::pi;

// The nameplate of the plant's motor; inertia of rotor and load together.
inline MotorData motor_data(const plant::Parameters& parameters) {
  const plant::Motor& motor = parameters.motor;
  MotorData data;
  data.counts_per_revolution = static_cast<std::uint32_t>(parameters.encoder.counts_per_revolution);
  data.phases = static_cast<std::uint8_t>(motor.phases);
  data.pole_pairs = static_cast<std::uint16_t>(motor.pole_pairs);
  data.rated_current_a = static_cast<float>(motor.rated_current_a * std::numbers::sqrt2);
  data.peak_current_a = 3.0F * data.rated_current_a;
  data.rated_torque_nm = static_cast<float>(motor.rated_torque_nm);
  data.torque_constant_nm_per_a =
      static_cast<float>(0.5 * motor.phases * motor.pole_pairs * plant::flux_linkage_vs(motor));
  data.resistance_ohm = static_cast<float>(motor.resistance_ohm);
  data.inductance_d_h = static_cast<float>(motor.direct_inductance_h);
  data.inductance_q_h = static_cast<float>(motor.quadrature_inductance_h);
  data.inertia_kgm2 = static_cast<float>(motor.rotor_inertia_kgm2 + parameters.load.inertia_kgm2);
  data.commutation_offset_turns = static_cast<float>(parameters.encoder.commutation_offset_turns);
  data.phase_order_reversed = parameters.encoder.direction < 0;
  return data;
}

// The default motor and load on a charged DC link, without friction and without temperature rise.
inline plant::Parameters frictionless(std::int32_t counts_per_revolution) {
  plant::Parameters parameters;
  parameters.encoder.counts_per_revolution = counts_per_revolution;
  parameters.load.viscous_friction_nms = 0.0;
  parameters.load.coulomb_friction_nm = 0.0;
  parameters.load.static_friction_nm = 0.0;
  parameters.motor.copper_temperature_coefficient = 0.0;
  parameters.supply.charged_at_start = true;
  return parameters;
}

struct Axis {
  explicit Axis(const plant::Parameters& parameters, Rates rates_ = {}, Bandwidths bandwidths = {})
      : plant(parameters),
        motor(motor_data(parameters)),
        rates(rates_),
        gains(default_gains(motor, rates, bandwidths)),
        counts_per_rad(motor.counts_per_revolution / (2.0 * pi)) {
    plant.sample(feedback);
    actuation.pwm_enabled = true;
    actuation.dc_link_connected = true;
    actuation.brake_released = true;
    configure();
    cascade.enable(feedback);
    demand.position = feedback.position_counts;
    demand.torque_limit_positive = demand.torque_limit_negative = 3.0F;
    demand.velocity_limit_positive = demand.velocity_limit_negative = 1.0e12F;
  }

  void configure() { cascade.configure(motor, gains, rates); }

  void tick() {
    if (cascade.position_loop_due()) cascade.set_demand(demand);
    cascade.tick(feedback, actuation);
    plant.step(actuation, feedback);
  }
  void run_seconds(double seconds) {
    for (auto ticks = std::lround(seconds / tick_seconds); ticks > 0; --ticks) tick();
  }

  double counts_per_s(double rpm) const { return rpm / 60.0 * motor.counts_per_revolution; }
  double measured_rpm() const {
    return static_cast<double>(cascade.state().velocity_counts_per_s) * 60.0 / motor.counts_per_revolution;
  }

  plant::Plant plant;
  MotorData motor;
  Rates rates;
  Gains gains;
  double counts_per_rad;
  Cascade cascade;
  Feedback feedback;
  Actuation actuation;
  LoopDemand demand;
};

}  // namespace servodrome::drive::test
