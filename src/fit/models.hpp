#pragma once

#include "fit/fit.hpp"
#include "fit/regression.hpp"

// The two halves of the axis. Each says what it has found, and why it has not found the rest.
namespace servodrome::fit {

struct Electrical {
  std::optional<Unknown> resistance;
  std::optional<Unknown> direct_inductance;
  std::optional<Unknown> quadrature_inductance;
  std::optional<Unknown> voltage_constant;  // V of amplitude per rad/s of the shaft; below 0: turns backwards
  std::optional<Unknown> delay_s;           // of the current behind the voltage
  std::optional<Unknown> stage_drop_v;
  double residual_rms = 0.0;
  std::size_t windows = 0;
};

// vq = R iq + Lq diq/dt + we Ld id + K w, vd = R id + Ld did/dt - we Lq iq, each with what the stage drops along the
// current; voltages are those of `delay` ago, turned by the angle that the rotor has gone meanwhile. Needs vq and iq,
// and a velocity (or position); uses vd, id, pole pairs and the temperature where they are known.
Electrical fit_electrical(const Signals& signals, const Motor& motor);

struct Mechanical {
  std::optional<Unknown> inertia;
  std::optional<Unknown> viscous_friction;
  std::optional<Unknown> coulomb_friction;
  std::optional<Unknown> weight;
  std::optional<Unknown> delay_s;  // of the motion behind the torque
  double residual_rms = 0.0;
  std::size_t windows = 0;
};

// torque = J dw/dt + B w + C sign(w) + weight, the torque of `delay` ago; only while the shaft turns faster than a
// twentieth of the greatest speed.
Mechanical fit_mechanical(const Signals& signals, const std::vector<double>& torque_nm);

// The velocity of each sample: recorded, or the slope of the position around it.
std::vector<double> velocity_of(const Signals& signals);

// A column that shows its unknown: mostly signal, and not what the other columns show as well.
inline bool shown(const Unknown& unknown) {
  constexpr double least_signal = 0.02;
  constexpr double least_independent = 1e-4;
  return unknown.signal_share > least_signal && unknown.independent_share > least_independent;
}

}  // namespace servodrome::fit
