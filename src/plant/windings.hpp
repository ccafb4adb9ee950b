#pragma once

#include <cmath>
#include <span>

#include "drive/hardware.hpp"
#include "plant/parameters.hpp"

// The electrical side of the motor in the rotor frame (d on the magnet, amplitude-invariant):
//   Ld did/dt = vd - R id + we Lq iq,   Lq diq/dt = vq - R iq - we (Ld id + flux),
//   torque = n/2 p (flux + (Ld - Lq) id) iq,   n phases.
//
// The inverter's voltage is constant in the stator frame while the rotor turns. For a round rotor (Ld = Lq) at constant
// speed the solution of a tick is a closed form, means of exponentials, evaluated as a series in the angle of the tick.
// A salient rotor, one that turns far in a tick, and all switches open are solved in pieces, with the stator's flux
// linkage, which turning does not change. docs/decisions/0020-windings-turn-exactly.md has the formulas.
//
// The speed is predicted. The change of speed by the torque of the same tick is part of the solution:
// mean velocity = offset + slope * torque.
// So the coupling of windings and shaft stays stable even for a light rotor or a small inductance.
namespace servodrome::plant {

struct ShaftResponse {
  double offset_rad_s = 0.0;  // mean velocity of the tick without electromagnetic torque
  double slope = 0.0;         // rad/s per Nm; 0 while the rotor stands still
};

// Predicted rotation of the rotor in a tick.
struct Turn {
  double speed = 0.0;  // mean speed of the shaft, rad/s
  double angle = 0.0;  // electrical rad per tick
};

// Linearisation point of a tick, where its solution needs one.
struct Guess {
  double torque_nm = 0.0;
  double direct_a;
};

// Rotor-frame quantities of one tick.
struct WindingTick {
  double mean_direct_a = 0.0;  // mean current, which makes torque and heat
  double mean_quadrature_a = 0.0;
  double end_direct_a = 0.0;
  double end_quadrature_a = 0.0;
  double more_heat_a2 = 0.0;  // mean square current minus the square of the mean: additional heat
  double power_w = 0.0;       // from the inverter into the motor
  double torque_nm = 0.0;
  double unforeseen_rad_s = 0.0;  // driven(): real minus predicted mean speed of the shaft
};

// A direction in the rotor frame: that of the only current that flows while one phase is open.
struct Axis {
  double direct;
  double quadrature;
};

class Windings {
 public:
  explicit Windings(const Motor& motor, int direction);

  void set_resistance_ohm(double resistance_ohm);
  double resistance_ohm() const { return resistance_; }
  void set_flux_vs(double flux_vs);  // flux linkage of the magnets, amplitude

  // Returns true if the angle is small enough for driven().
  bool turns_little(const Turn& turn) const { return std::abs(turn.angle) < small_angle_; }

  // The inverter applies a voltage, given in the rotor frame at the start of the tick.
  WindingTick driven(double direct_v, double quadrature_v, const Turn& turn, const ShaftResponse& shaft) const {
    const double angle = turn.angle;
    const double square = angle * angle;
    const Complex kept = of(kept_, angle, square);
    const Complex pushed = of(pushed_, angle, square);
    const Complex opposed = of(opposed_, angle, square);
    const Complex seen = of(seen_, angle, square);
    const double foreseen = opposed.re * (angle * flux_by_inductance_);
    const double free_q =
        (kept.re * quadrature_a + kept.im * direct_a) + ((pushed.re * quadrature_v + pushed.im * direct_v) - foreseen);
    // Includes the change of speed that this torque causes.
    const double per_speed_nm = opposed.re * per_speed_nm_;
    const double share = 1.0 / (1.0 + per_speed_nm * shaft.slope);  // independent of the voltage, so calculated early
    const double ahead = shaft.offset_rad_s - turn.speed;
    const double torque_nm = (torque_constant_ * free_q - per_speed_nm * ahead) * share;
    const double unforeseen = ahead + shaft.slope * torque_nm;
    const double emf = angle * flux_by_inductance_ + unforeseen * emf_per_speed_;

    const double mean_q = torque_nm * ampere_per_nm_;  // the processor has it earlier than by way of the speed
    const double mean_d = (kept.re * direct_a - kept.im * quadrature_a) +
                          ((pushed.re * direct_v - pushed.im * quadrature_v) + opposed.im * emf);
    const double mean_direct_v = seen.re * direct_v - seen.im * quadrature_v;
    const double mean_quadrature_v = seen.re * quadrature_v + seen.im * direct_v;
    const double change_d = (mean_direct_v * per_volt_ - decay_ * mean_d) + angle * mean_q;
    const double change_q = (mean_quadrature_v * per_volt_ - decay_ * mean_q) - (angle * mean_d + emf);
    // Voltage and current both turn within the tick, so the power differs from the product of their means.
    const double turned_w = angle * (1.0 / 12.0) * (mean_quadrature_v * change_d - mean_direct_v * change_q);
    return {.mean_direct_a = mean_d,
            .mean_quadrature_a = mean_q,
            .end_direct_a = direct_a + change_d,
            .end_quadrature_a = quadrature_a + change_q,
            .power_w = phase_factor_ * ((mean_direct_v * mean_d + mean_quadrature_v * mean_q) + turned_w),
            .torque_nm = torque_nm,
            .unforeseen_rad_s = unforeseen};
  }

  // The same while the shaft is held: the rotor does not turn, and no torque changes that. Equal to driven() but for
  // rounding.
  WindingTick driven_at_rest(double direct_v, double quadrature_v) const {
    const double mean_d = kept_.zeroth * direct_a + pushed_.zeroth * direct_v;
    const double mean_q = kept_.zeroth * quadrature_a + pushed_.zeroth * quadrature_v;
    return {.mean_direct_a = mean_d,
            .mean_quadrature_a = mean_q,
            .end_direct_a = direct_a + (direct_v * per_volt_ - decay_ * mean_d),
            .end_quadrature_a = quadrature_a + (quadrature_v * per_volt_ - decay_ * mean_q),
            .power_w = phase_factor_ * (direct_v * mean_d + quadrature_v * mean_q),
            .torque_nm = torque_constant_ * mean_q};
  }

  // As driven(), for any rotor at any speed.
  WindingTick driven_in_pieces(double direct_v, double quadrature_v, const Turn& turn) const;

  // Approximate decrease of the mean torque with the speed, Nm per rad/s.
  double per_speed_nm() const { return opposed_.zeroth * per_speed_nm_; }

  // All switches open: the diodes of the bridge limit the voltages between the phases to the DC link's, and conduct
  // where these would exceed it. `sine` and `cosine` belong to the angle at the start of the tick.
  WindingTick freewheeling(double dc_link_v, double sine, double cosine, const Turn& turn) const;

  // One phase open: current flows only along `axis` (a unit vector, at mid-tick). `voltage_v` is along it, or, with
  // `freewheeling`, the magnitude that opposes the current. Backward Euler, linearised at the guess.
  WindingTick along(Axis axis, double voltage_v, bool freewheeling, const ShaftResponse& shaft,
                    const Guess& guess) const;

  void commit(const WindingTick& tick) {
    direct_a = tick.end_direct_a;
    quadrature_a = tick.end_quadrature_a;
  }

  double magnetic_j() const {
    return phase_factor_ * (0.5 * direct_inductance_ * direct_a * direct_a + quadrature_.magnetic_j(quadrature_a));
  }
  double pole_pairs() const { return pole_pairs_; }  // negative if the encoder counts in the other direction
  // Half the number of phases: the factor on products of amplitudes for power and heat.
  double phase_factor() const { return phase_factor_; }
  // Voltage with which the open bridge opposes a current, and which a source must exceed to drive one, per DC link
  // voltage.
  double bridge_share() const { return bridge_share_; }

  double direct_a = 0.0;  // state: currents at the end of the last tick
  double quadrature_a = 0.0;

 private:
  struct Complex {
    double re;
    double im;
  };
  // Weighted mean over a tick of a vector that turns back by the angle: a series in the angle with the moments of the
  // weight as coefficients. Its error is less than 4e-5 for angles below `small_angle`.
  struct Series {
    double zeroth = 0.0;
    double first = 0.0;
    double second = 0.0;
    double third = 0.0;
  };
  static constexpr double small_angle = 0.25;
  static Complex of(const Series& series, double angle, double square) {
    return {series.zeroth + square * series.second, angle * (series.first + square * series.third)};
  }

  // The flux linkage of a q current i: inductance * i, or with saturation (saturated + (inductance - saturated) / (1 +
  // i / scale)) * i.
  struct Quadrature {
    double saturated_h;
    double unsaturated_h;  // the part that falls with the current; 0: no saturation
    double scale_a;

    double inductance_h(double current_a) const {
      return saturated_h + unsaturated_h * scale_a / (scale_a + std::abs(current_a));
    }
    double flux_vs(double current_a) const { return inductance_h(current_a) * current_a; }
    double slope_h(double current_a) const {  // of the flux
      const double share = scale_a / (scale_a + std::abs(current_a));
      return saturated_h + unsaturated_h * share * share;
    }
    double current_a(double flux_vs) const;
    double magnetic_j(double current_a) const;  // integral of current over flux
  };

  static Series series_of(std::span<const double> moments);

  // Parameters of a tick that is divided into pieces.
  struct Pieces {
    int count = 1;
    double direct_rate = 0.0;  // L / duration
    double quadrature_rate = 0.0;
    double direct_weight = 0.5;  // weight of the final current in the mean
    double quadrature_weight = 0.5;
  };
  template <typename Voltage>
  WindingTick in_pieces(const Pieces& pieces, const Turn& turn, bool passive, const Voltage& voltage) const;
  template <typename Voltage>
  WindingTick in_saturated_pieces(const Pieces& pieces, const Turn& turn, bool passive, const Voltage& voltage) const;
  struct PieceSums;
  WindingTick mean_of(const PieceSums& sums, int pieces) const;
  void prepare_pieces();

  double phase_factor_;
  double pole_pairs_;
  double torque_per_flux_;  // n/2 p
  double flux_ = 0.0;
  double torque_constant_ = 0.0;  // Nm per A of amplitude
  double ampere_per_nm_ = 0.0;    // without direct current
  double direct_inductance_;
  double quadrature_inductance_;
  Quadrature quadrature_;
  double saliency_;     // Ld - Lq, without saturation
  double small_angle_;  // 0 for a salient rotor and with saturation
  double flux_by_inductance_ = 0.0;
  double per_volt_;  // h / L
  double resistance_ = 0.0;
  double decay_ = 0.0;          // R h / L
  Series kept_;                 // mean current (round rotor): per A of the initial current,
  Series pushed_;               // per V of the voltage,
  Series opposed_;              // and per A of (back-EMF * h / L)
  Series seen_;                 // mean voltage, per V
  double emf_per_speed_ = 0.0;  // back-EMF * h / L per rad/s of the shaft, the input of `opposed_`
  double per_speed_nm_ = 0.0;   // the same times the torque constant
  double bridge_share_;
  Pieces whole_;
  Pieces pieces_;
};

}  // namespace servodrome::plant
