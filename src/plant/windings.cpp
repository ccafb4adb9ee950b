#include "plant/windings.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "drive/hardware.hpp"
#include "plant/fitting.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {
constexpr double one_over_sqrt3 = 0.57735026918962576;

// Means of s^k exp(-decay s) over s from 0 to 1. The highest comes from a series or, if that converges slowly, from the
// closed form; the others follow by partial integration.
std::array<double, 5> moments_of(double decay) {
  constexpr std::size_t highest = 4;
  std::array<double, highest + 1> moments{};
  const double end = std::exp(-decay);
  if (decay < 2.0) {
    double power = 1.0;
    for (double n = 0.0; std::abs(power) > 1.0e-18; n += 1.0) {
      moments[highest] += power / (n + highest + 1.0);
      power *= -decay / (n + 1.0);
    }
    for (std::size_t k = highest; k > 0; --k) moments[k - 1] = (decay * moments[k] + end) / static_cast<double>(k);
  } else {
    moments[0] = (1.0 - end) / decay;
    for (std::size_t k = 1; k <= highest; ++k) {
      moments[k] = (static_cast<double>(k) * moments[k - 1] - end) / decay;
    }
  }
  return moments;
}
}  // namespace

double flux_linkage_vs(const Motor& motor) {
  // Torque per A rms = phases / 2 p flux sqrt(2).
  return motor.torque_constant_nm_per_a / (0.5 * motor.phases * motor.pole_pairs * std::sqrt(2.0));
}

Windings::Windings(const Motor& motor, int direction)
    : phase_factor_(0.5 * motor.phases),
      pole_pairs_(direction * motor.pole_pairs),
      torque_per_flux_(phase_factor_ * pole_pairs_),
      direct_inductance_(motor.direct_inductance_h),
      quadrature_inductance_(motor.quadrature_inductance_h),
      quadrature_{motor.quadrature_inductance_h, 0.0, 1.0},
      saliency_(motor.direct_inductance_h - motor.quadrature_inductance_h),
      small_angle_(saliency_ == 0.0 && motor.quadrature_saturation_a == 0.0 ? small_angle : 0.0),
      per_volt_(h / motor.quadrature_inductance_h),
      bridge_share_(motor.phases == 2 ? 1.0 : one_over_sqrt3) {
  if (motor.quadrature_saturation_a > 0.0) {
    const double saturated_h = motor.saturated_inductance_share * motor.quadrature_inductance_h;
    quadrature_ = {saturated_h, motor.quadrature_inductance_h - saturated_h, motor.quadrature_saturation_a};
  }
  set_flux_vs(flux_linkage_vs(motor));
  set_resistance_ohm(motor.resistance_ohm);
}

void Windings::set_flux_vs(double flux_vs) {
  flux_ = flux_vs;
  torque_constant_ = torque_per_flux_ * flux_;
  ampere_per_nm_ = 1.0 / torque_constant_;
  flux_by_inductance_ = flux_ / quadrature_inductance_;
  emf_per_speed_ = h * pole_pairs_ * flux_by_inductance_;
  per_speed_nm_ = emf_per_speed_ * torque_constant_;
}

// Series of exp(-j angle s) in powers of the angle, from the moments of a weight function.
Windings::Series Windings::series_of(std::span<const double> moments) {
  return {moments[0], -moments[1], -moments[2] / 2.0, moments[3] / 6.0};
}

void Windings::set_resistance_ohm(double resistance_ohm) {
  resistance_ = resistance_ohm;
  decay_ = resistance_ * per_volt_;
  // For a share s of the tick: exp(-decay s) of the initial current remains, (1 - exp(-decay s)) / decay is the current
  // that the voltage made, and 1 - s remains for the current that an EMF drives from s on. The voltage itself is
  // constant.
  const std::array<double, 5> keeps = moments_of(decay_);
  std::array<double, 4> makes{};
  std::array<double, 4> left{};
  std::array<double, 4> even{};
  for (std::size_t k = 0; k < even.size(); ++k) {
    even[k] = 1.0 / static_cast<double>(k + 1);
    makes[k] = per_volt_ * (even[k] - keeps[k]) / decay_;
    left[k] = keeps[k] - keeps[k + 1];
  }
  kept_ = series_of(keeps);
  pushed_ = series_of(makes);
  opposed_ = series_of(left);
  seen_ = series_of(even);

  prepare_pieces();
}

WindingTick Windings::along(Axis axis, double voltage_v, bool freewheeling, const ShaftResponse& shaft,
                            const Guess& guess) const {
  const double torque_nm = guess.torque_nm;
  // With i = n y and n fixed to the stator, dn/dt = -we J n in the rotor frame; the inductance along n is Ln = Ld nd^2
  // + Lq nq^2 and changes as the rotor turns.
  const double speed = pole_pairs_ * (shaft.offset_rad_s + shaft.slope * torque_nm);
  const double product = axis.direct * axis.quadrature;
  const double quadrature_h = quadrature_.inductance_h(quadrature_a);
  const double saliency = direct_inductance_ - quadrature_h;
  const double inductance =
      direct_inductance_ * axis.direct * axis.direct + quadrature_h * axis.quadrature * axis.quadrature;
  const double old = axis.direct * direct_a + axis.quadrature * quadrature_a;
  const double flux_q = axis.quadrature * (flux_ + saliency * guess.direct_a);
  const double coupling = pole_pairs_ * shaft.slope * flux_q;
  const double memory = inductance / h;
  const double impedance = std::max(memory + resistance_ + 2.0 * speed * product * saliency, resistance_) +
                           coupling * torque_per_flux_ * flux_q;
  double source = memory * old - speed * flux_ * axis.quadrature + coupling * torque_nm;
  double voltage = voltage_v;
  if (freewheeling) voltage = -std::clamp(source, -voltage_v, voltage_v);
  source += voltage;
  const double y = source / impedance;
  const double d = axis.direct * y;
  const double q = axis.quadrature * y;
  return {.mean_direct_a = d,
          .mean_quadrature_a = q,
          .end_direct_a = d,
          .end_quadrature_a = q,
          .power_w = phase_factor_ * voltage * y,
          .torque_nm = torque_per_flux_ * (flux_ + saliency * d) * q};
}

}  // namespace servodrome::plant
