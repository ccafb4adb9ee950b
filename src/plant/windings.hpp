#pragma once

#include <cmath>

#include "drive/hardware.hpp"
#include "plant/parameters.hpp"

// The electrical side of the motor in the rotor frame (d on the magnet, amplitude-invariant):
//   Ld did/dt = vd - R id + we Lq iq,   Lq diq/dt = vq - R iq - we (Ld id + flux),
//   torque = n/2 p (flux + (Ld - Lq) id) iq,   n phases.
//
// Each axis is integrated with the exponentially fitted weight of fitting.hpp: exact at standstill, exact in the steady
// state at any speed, second order in between (error (we h)^2 / 12 of the rotation in a tick). The shaft's response to
// the torque of the same tick, mean velocity = offset + slope * torque, is part of the equations, so that neither a
// light rotor nor a small inductance can make the two step on each other's heels.
namespace servodrome::plant {

struct ShaftResponse {
  double offset_rad_s = 0.0;  // mean velocity of the tick without electromagnetic torque
  double slope = 0.0;         // rad/s per Nm; 0 while the rotor stands still
};

struct Guess {
  double torque_nm = 0.0;
  double direct_a;
};

// Rotor-frame quantities of one tick.
struct WindingTick {
  double mean_direct_a = 0.0;  // the mean current: it makes the torque and the heat
  double mean_quadrature_a = 0.0;
  double end_direct_a = 0.0;
  double end_quadrature_a = 0.0;
  double more_heat_a2 = 0.0;  // square of the current that heats besides the mean's
  double power_w = 0.0;       // from the inverter into the motor
  double torque_nm = 0.0;
};

// A direction across the rotor frame: of the only current that flows while one phase is open.
struct Axis {
  double direct;
  double quadrature;
};

class Windings {
 public:
  explicit Windings(const Motor& motor, int direction);

  void set_resistance_ohm(double resistance_ohm);
  double resistance_ohm() const { return resistance_; }

  // Voltage applied by the inverter. `guess` is where the product of speed and current is linearised: the last tick.
  // With a round rotor (Ld = Lq) the result does not depend on it; a salient one may need a better guess, see
  // settled().
  WindingTick driven(double direct_v, double quadrature_v, const ShaftResponse& shaft, const Guess& guess) const {
    const double torque_nm = guess.torque_nm;
    const double effective_flux = flux_ + saliency_ * guess.direct_a;
    const double speed = pole_pairs_ * (shaft.offset_rad_s + shaft.slope * torque_nm);
    const double coupling = pole_pairs_ * shaft.slope * effective_flux;
    const double direct = direct_v + direct_memory_ * direct_a;
    const double quadrature = quadrature_v + (quadrature_memory_ * quadrature_a - speed * flux_ + coupling * torque_nm);
    const double direct_impedance = direct_memory_ + resistance_;
    const double quadrature_impedance = quadrature_memory_ + resistance_ + coupling * torque_per_flux_ * effective_flux;
    const double direct_reactance = speed * direct_inductance_;
    const double quadrature_reactance = speed * quadrature_inductance_;
    const double inverse = 1.0 / (direct_impedance * quadrature_impedance + direct_reactance * quadrature_reactance);
    const double mean_d = direct * (quadrature_impedance * inverse) + quadrature * (quadrature_reactance * inverse);
    const double mean_q = quadrature * (direct_impedance * inverse) - direct * (direct_reactance * inverse);
    return {.mean_direct_a = mean_d,
            .mean_quadrature_a = mean_q,
            .end_direct_a = direct_a + (mean_d - direct_a) * inverse_direct_weight_,
            .end_quadrature_a = quadrature_a + (mean_q - quadrature_a) * inverse_quadrature_weight_,
            .power_w = (direct_v * mean_d + quadrature_v * mean_q) * phase_factor_,
            .torque_nm = torque_nm_of(mean_d, mean_q)};
  }

  // All switches open: the current flows through the diodes against the DC link until it is gone, and again when the
  // back-EMF is higher than the link. The bridge is taken as a voltage opposing the current vector, of the smallest
  // back-EMF at which it conducts: dc_link_v / sqrt(3) of three phases (a line-to-line peak of dc_link_v), dc_link_v of
  // two windings with full bridges. Backward Euler, so that it ends at nothing.
  WindingTick freewheeling(double dc_link_v, const ShaftResponse& shaft, const Guess& guess) const;

  // One phase open: current only along `axis` (a unit vector, at mid-tick). `voltage_v` lies along it, or,
  // freewheeling, is the magnitude that opposes the current.
  WindingTick along(Axis axis, double voltage_v, bool freewheeling, const ShaftResponse& shaft,
                    const Guess& guess) const;

  // Whether the speed that made the currents is the speed their torque makes, to 1e-7 electrical rad in the tick.
  bool settled(const WindingTick& tick, const ShaftResponse& shaft, const Guess& guess) const {
    const double missed = std::abs(tick.torque_nm - guess.torque_nm) +
                          std::abs(torque_saliency_ * (tick.mean_direct_a - guess.direct_a) * tick.mean_quadrature_a);
    return saliency_ == 0.0 || std::abs(pole_pairs_ * shaft.slope) * missed * drive::tick_seconds < 1.0e-7;
  }

  void commit(const WindingTick& tick) {
    direct_a = tick.end_direct_a;
    quadrature_a = tick.end_quadrature_a;
  }

  double torque_nm_of(double direct, double quadrature) const {
    return (torque_constant_ + torque_saliency_ * direct) * quadrature;
  }
  double magnetic_j() const {
    return 0.5 * phase_factor_ *
           (direct_inductance_ * direct_a * direct_a + quadrature_inductance_ * quadrature_a * quadrature_a);
  }
  double pole_pairs() const { return pole_pairs_; }  // negative with an encoder that counts the other way
  // Half the number of phases: what products of amplitudes have to be taken by for power and heat.
  double phase_factor() const { return phase_factor_; }
  // What the open bridge holds against a current, and a voltage has to exceed to drive one, by the DC link's voltage.
  double bridge_share() const { return bridge_share_; }

  double direct_a = 0.0;  // state: currents at the end of the last tick
  double quadrature_a = 0.0;

 private:
  double phase_factor_;
  double pole_pairs_;
  double torque_per_flux_;  // n/2 p
  double flux_;
  double torque_constant_;  // Nm per A of amplitude, and by how much of it each A of direct current changes it
  double torque_saliency_;
  double direct_inductance_;
  double quadrature_inductance_;
  double saliency_;  // Ld - Lq
  double bridge_share_;
  double resistance_ = 0.0;
  double direct_memory_ = 0.0;  // L / (weight h): what the old current is worth in volts
  double quadrature_memory_ = 0.0;
  double inverse_direct_weight_ = 2.0;
  double inverse_quadrature_weight_ = 2.0;
};

}  // namespace servodrome::plant
