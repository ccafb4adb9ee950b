#pragma once

#include <array>
#include <cmath>
#include <numbers>

#include "drive/transforms.hpp"
#include "plant/plant.hpp"

// A plant on the test bench: stores actuation and feedback, and takes voltages in the rotor frame.
namespace servodrome::plant::test {

inline constexpr double h = drive::tick_seconds;
inline constexpr double rad_s_per_rpm = std::numbers::pi / 30.0;

// The default motor without friction or load, on a full DC link.
inline Parameters bare_motor() {
  Parameters p;
  p.load.inertia_kgm2 = 0.0;
  p.load.viscous_friction_nms = 0.0;
  p.load.coulomb_friction_nm = 0.0;
  p.load.static_friction_nm = 0.0;
  p.motor.copper_temperature_coefficient = 0.0;
  p.supply.charged_at_start = true;
  return p;
}

struct Rig {
  explicit Rig(const Parameters& parameters) : plant(parameters) {
    actuation.brake_released = true;
    actuation.dc_link_connected = true;
  }

  void step() { plant.step(actuation, feedback); }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) step();
  }
  // Sets a rotor-frame voltage at the angle of the middle of the next tick; then makes a step.
  void step_voltage(double direct_v, double quadrature_v) {
    const Parameters& p = plant.parameters();
    const double ahead = 0.5 * h * plant.velocity_rpm() / 60.0 * p.motor.pole_pairs * p.encoder.direction;
    const double turns = plant.electrical_angle_turns() + ahead;
    const double angle = 2.0 * std::numbers::pi * (turns - std::floor(turns));
    const double alpha = direct_v * std::cos(angle) - quadrature_v * std::sin(angle);
    const double beta = direct_v * std::sin(angle) + quadrature_v * std::cos(angle);
    actuation.pwm_enabled = true;
    set_voltage(alpha, beta);
    step();
  }
  void set_voltage(double alpha, double beta) {
    const auto volts = [](double v) { return static_cast<float>(v); };
    if (plant.parameters().motor.phases == 2) {
      actuation.phase_voltage_v = {volts(alpha), volts(beta), 0.0F};
    } else {
      actuation.phase_voltage_v = {volts(alpha), volts(-0.5 * alpha + std::sqrt(0.75) * beta),
                                   volts(-0.5 * alpha - std::sqrt(0.75) * beta)};
    }
  }
  double speed_rad_s() const { return plant.velocity_rpm() * rad_s_per_rpm; }
  // Accelerates the rotor to a speed by an external torque, without current.
  void spin_up(double speed_rpm) {
    actuation.pwm_enabled = false;
    const double before = plant.parameters().load.external_torque_nm;
    const double inertia = plant.parameters().motor.rotor_inertia_kgm2 + plant.parameters().load.inertia_kgm2;
    plant.set_external_torque_nm(-speed_rpm * rad_s_per_rpm * inertia / h);
    step();
    plant.set_external_torque_nm(before);
  }

  Plant plant;
  drive::Actuation actuation;
  drive::Feedback feedback;
};

// The motor by its continuous equations, integrated in small steps: the reference for the plant.
struct ReferenceMotor {
  explicit ReferenceMotor(const Parameters& parameters)
      : p(parameters),
        flux(flux_linkage_vs(parameters.motor)),
        inertia(parameters.motor.rotor_inertia_kgm2 + parameters.load.inertia_kgm2),
        viscous(parameters.motor.viscous_friction_nms + parameters.load.viscous_friction_nms) {}

  using State = std::array<double, 4>;  // d current, q current, speed, position in rad

  // The stationary-frame voltage is constant; the rotation within the step is exact.
  State derivative(const State& s, double alpha_v, double beta_v) const {
    const Motor& m = p.motor;
    const double angle = m.pole_pairs * s[3];
    const double vd = alpha_v * std::cos(angle) + beta_v * std::sin(angle);
    const double vq = beta_v * std::cos(angle) - alpha_v * std::sin(angle);
    const double we = m.pole_pairs * s[2];
    const double ld = m.direct_inductance_h;
    // With saturation the flux of the q axis is (saturated + rest / (1 + |i| / scale)) i.
    const double scale = m.quadrature_saturation_a > 0.0 ? m.quadrature_saturation_a : 1.0e30;
    const double saturated = m.saturated_inductance_share * m.quadrature_inductance_h;
    const double share = 1.0 / (1.0 + std::abs(s[1]) / scale);
    const double flux_q = (saturated + (m.quadrature_inductance_h - saturated) * share) * s[1];
    const double slope_q = saturated + (m.quadrature_inductance_h - saturated) * share * share;
    const double torque = 0.5 * m.phases * m.pole_pairs * ((flux + ld * s[0]) * s[1] - flux_q * s[0]);
    return {(vd - m.resistance_ohm * s[0] + we * flux_q) / ld,
            (vq - m.resistance_ohm * s[1] - we * (ld * s[0] + flux)) / slope_q,
            locked ? 0.0 : (torque - viscous * s[2] - p.load.external_torque_nm) / inertia, s[2]};
  }

  void advance(double seconds, double alpha_v, double beta_v) {  // Runge-Kutta of order 4, 1 us
    const int steps = static_cast<int>(std::lround(seconds / 1.0e-6 * 2.0)) / 2 + 1;
    const double dt = seconds / steps;
    for (int i = 0; i < steps; ++i) {
      const State k1 = derivative(state, alpha_v, beta_v);
      const State k2 = derivative(moved(k1, 0.5 * dt), alpha_v, beta_v);
      const State k3 = derivative(moved(k2, 0.5 * dt), alpha_v, beta_v);
      const State k4 = derivative(moved(k3, dt), alpha_v, beta_v);
      for (std::size_t j = 0; j < 4; ++j) state[j] += dt / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
    }
  }

  Parameters p;
  double flux;
  double inertia;
  double viscous;
  bool locked = false;
  State state{};

 private:
  State moved(const State& slope, double dt) const {
    State result = state;
    for (std::size_t j = 0; j < 4; ++j) result[j] += dt * slope[j];
    return result;
  }
};

}  // namespace servodrome::plant::test
