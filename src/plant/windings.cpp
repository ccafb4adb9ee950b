#include "plant/windings.hpp"

#include <algorithm>
#include <cmath>

#include "drive/hardware.hpp"
#include "plant/fitting.hpp"

namespace servodrome::plant {

namespace {
constexpr double h = drive::tick_seconds;
constexpr double one_over_sqrt3 = 0.57735026918962576;
}  // namespace

double flux_linkage_vs(const Motor& motor) {
  // Torque per A rms = phases / 2 p flux sqrt(2).
  return motor.torque_constant_nm_per_a / (0.5 * motor.phases * motor.pole_pairs * std::sqrt(2.0));
}

Windings::Windings(const Motor& motor, int direction)
    : phase_factor_(0.5 * motor.phases),
      pole_pairs_(direction * motor.pole_pairs),
      torque_per_flux_(phase_factor_ * pole_pairs_),
      flux_(flux_linkage_vs(motor)),
      torque_constant_(torque_per_flux_ * flux_),
      torque_saliency_(torque_per_flux_ * (motor.direct_inductance_h - motor.quadrature_inductance_h)),
      direct_inductance_(motor.direct_inductance_h),
      quadrature_inductance_(motor.quadrature_inductance_h),
      saliency_(motor.direct_inductance_h - motor.quadrature_inductance_h),
      bridge_share_(motor.phases == 2 ? 1.0 : one_over_sqrt3) {
  set_resistance_ohm(motor.resistance_ohm);
}

void Windings::set_resistance_ohm(double resistance_ohm) {
  resistance_ = resistance_ohm;
  const double direct_weight = fitted_weight(resistance_ * h / direct_inductance_);
  const double quadrature_weight = fitted_weight(resistance_ * h / quadrature_inductance_);
  inverse_direct_weight_ = 1.0 / direct_weight;
  inverse_quadrature_weight_ = 1.0 / quadrature_weight;
  direct_memory_ = direct_inductance_ / (direct_weight * h);
  quadrature_memory_ = quadrature_inductance_ / (quadrature_weight * h);
}

WindingTick Windings::freewheeling(double dc_link_v, const ShaftResponse& shaft, const Guess& guess) const {
  const double torque_nm = guess.torque_nm;
  const double effective_flux = flux_ + saliency_ * guess.direct_a;
  const double speed = pole_pairs_ * (shaft.offset_rad_s + shaft.slope * torque_nm);
  const double coupling = pole_pairs_ * shaft.slope * effective_flux;
  const double direct = direct_inductance_ / h * direct_a;
  const double quadrature = quadrature_inductance_ / h * quadrature_a - speed * flux_ + coupling * torque_nm;
  const double threshold = dc_link_v * bridge_share_;
  const double source2 = direct * direct + quadrature * quadrature;
  const double margin = source2 - threshold * threshold;
  // What backward Euler leaves out of the energy of a current that falls: half L di^2.
  const auto left_out_w = [&](double end_d, double end_q) {
    const double change_d = end_d - direct_a;
    const double change_q = end_q - quadrature_a;
    return phase_factor_ * 0.5 / h *
           (direct_inductance_ * change_d * change_d + quadrature_inductance_ * change_q * change_q);
  };
  if (margin <= 0.0) return {.power_w = -left_out_w(0.0, 0.0)};  // it died within the tick, through the diodes
  const double direct_impedance = direct_inductance_ / h + resistance_;
  const double quadrature_impedance =
      quadrature_inductance_ / h + resistance_ + coupling * torque_per_flux_ * effective_flux;
  const double direct_reactance = speed * direct_inductance_;
  const double quadrature_reactance = speed * quadrature_inductance_;
  // |current| from (Z r + threshold)^2 + (X r)^2 = source^2, with the mean of the axes for Z; the bridge then looks
  // like a resistance of threshold / r.
  const double z = 0.5 * (direct_impedance + quadrature_impedance);
  const double square = z * z + direct_reactance * quadrature_reactance;
  const double half = z * threshold;
  const double magnitude = margin / (half + std::sqrt(half * half + square * margin));
  const double bridge = threshold / magnitude;
  const double a = direct_impedance + bridge;
  const double b = quadrature_impedance + bridge;
  const double inverse = 1.0 / (a * b + direct_reactance * quadrature_reactance);
  const double d = (direct * b + quadrature_reactance * quadrature) * inverse;
  const double q = (quadrature * a - direct_reactance * direct) * inverse;
  // The link takes what its voltage takes of the current that flowed more than at the end of the tick, the resistance
  // the rest.
  const double square_a = d * d + q * q;
  const double more_a = std::sqrt(direct_a * direct_a + quadrature_a * quadrature_a) - std::sqrt(square_a);
  const double left_out = left_out_w(d, q);
  const double to_link = std::min(left_out, phase_factor_ * 0.5 * threshold * std::max(0.0, more_a));
  return {.mean_direct_a = d,
          .mean_quadrature_a = q,
          .end_direct_a = d,
          .end_quadrature_a = q,
          .more_heat_a2 = (left_out - to_link) / (phase_factor_ * resistance_),
          .power_w = -phase_factor_ * bridge * square_a - to_link,
          .torque_nm = torque_nm_of(d, q)};
}

WindingTick Windings::along(Axis axis, double voltage_v, bool freewheeling, const ShaftResponse& shaft,
                            const Guess& guess) const {
  const double torque_nm = guess.torque_nm;
  // With i = n y and n fixed to the stator, dn/dt = -we J n in the rotor frame; the inductance along n is
  // Ln = Ld nd^2 + Lq nq^2 and changes as the rotor turns.
  const double speed = pole_pairs_ * (shaft.offset_rad_s + shaft.slope * torque_nm);
  const double product = axis.direct * axis.quadrature;
  const double inductance =
      direct_inductance_ * axis.direct * axis.direct + quadrature_inductance_ * axis.quadrature * axis.quadrature;
  const double old = axis.direct * direct_a + axis.quadrature * quadrature_a;
  const double flux_q = axis.quadrature * (flux_ + saliency_ * guess.direct_a);
  const double coupling = pole_pairs_ * shaft.slope * flux_q;
  const double memory = inductance / h;
  const double impedance = std::max(memory + resistance_ + 2.0 * speed * product * saliency_, resistance_) +
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
          .torque_nm = torque_nm_of(d, q)};
}

}  // namespace servodrome::plant
