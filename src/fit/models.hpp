#pragma once

#include "fit/fit.hpp"
#include "fit/regression.hpp"

// The two models of the axis. Each returns the values that it found.
namespace servodrome::fit {

struct Electrical {
  std::optional<Unknown> resistance;
  std::optional<Unknown> direct_inductance;
  std::optional<Unknown> quadrature_inductance;
  std::optional<Unknown> voltage_constant;  // V of amplitude per rad/s of the shaft; negative: Result::turns_backwards
  std::optional<Unknown> delay_s;           // delay from voltage to current
  std::optional<Unknown> stage_drop_v;
  bool stage_loses = false;  // the drop is not small against the voltage of the resistance
  double residual_rms = 0.0;
  std::size_t windows = 0;
};

// vq = R iq + Lq diq/dt + we Ld id + K w, vd = R id + Ld did/dt - we Lq iq, each plus the voltage drop of the power
// stage along the current. The voltages are those from `delay` earlier, turned by the angle of the rotor since then.
// Needs vq, iq, and velocity or position; uses vd, id, pole pairs and temperature if they are known.
Electrical fit_electrical(const Signals& signals, const Motor& motor);

struct Mechanical {
  std::optional<Unknown> inertia;
  std::optional<Unknown> viscous_friction;
  std::optional<Unknown> coulomb_friction;
  std::optional<Unknown> weight;
  std::optional<Unknown> delay_s;  // delay from torque to motion
  double residual_rms = 0.0;
  std::size_t windows = 0;
};

// torque = J dw/dt + B w + C sign(w) + weight, with the torque from `delay` earlier. Uses only times at which the shaft
// turns faster than a twentieth of its greatest speed.
Mechanical fit_mechanical(const Signals& signals, const std::vector<double>& torque_nm);

// The velocity of each sample: as recorded, or from the slope of the position.
std::vector<double> velocity_of(const Signals& signals);

// True if the column determines its unknown: it has enough signal, and is not a combination of the other columns.
inline bool shown(const Unknown& unknown) {
  constexpr double least_signal = 0.02;
  constexpr double least_independent = 1e-4;
  return unknown.signal_share > least_signal && unknown.independent_share > least_independent;
}

}  // namespace servodrome::fit
