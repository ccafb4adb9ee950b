// Windings solved in pieces of a tick: for a salient or fast rotor, and with all switches open.
#include <cmath>

#include "drive/hardware.hpp"
#include "plant/diode_bridge.hpp"
#include "plant/fitting.hpp"
#include "plant/windings.hpp"

namespace servodrome::plant {

namespace {

constexpr int pieces_per_tick = 16;
constexpr int saturated_pieces = 4;  // of a tick at low speed: within one piece turning and voltage follow each other

// The vector in the frame of the rotor after it has turned.
Vector turned(Vector a, double sine, double cosine) { return {cosine * a.d + sine * a.q, cosine * a.q - sine * a.d}; }

}  // namespace

void Windings::prepare_pieces() {
  for (Pieces* pieces : {&whole_, &pieces_}) {
    pieces->count = pieces == &pieces_ ? pieces_per_tick : quadrature_.unsaturated_h != 0.0 ? saturated_pieces : 1;
    pieces->direct_rate = direct_inductance_ * pieces->count / drive::tick_seconds;
    pieces->quadrature_rate = quadrature_inductance_ * pieces->count / drive::tick_seconds;
    pieces->direct_weight = fitted_weight(resistance_ / pieces->direct_rate);
    pieces->quadrature_weight = fitted_weight(resistance_ / pieces->quadrature_rate);
  }
}

// Sums over the pieces of a tick, and the currents at its end.
struct Windings::PieceSums {
  Vector current;
  Vector end;
  double square_a2;
  double power_w;
  double torque_vs;
};

WindingTick Windings::mean_of(const PieceSums& sums, int pieces) const {
  const double share = 1.0 / pieces;
  const Vector mean = share * sums.current;
  return {.mean_direct_a = mean.d,
          .mean_quadrature_a = mean.q,
          .end_direct_a = sums.end.d,
          .end_quadrature_a = sums.end.q,
          .more_heat_a2 = share * sums.square_a2 - dot(mean, mean),
          .power_w = phase_factor_ * share * sums.power_w,
          .torque_nm = torque_per_flux_ * share * sums.torque_vs};
}

// The stator's flux linkage changes by the voltage minus the resistive drop, independent of the rotor: the rotation
// only turns the initial linkage. Torque and heat are calculated so that the energy balance of a piece is exact for
// every saliency and angle; so no oscillation can grow. `passive`: the voltage source cannot give energy. If it would
// with the mean current of the piece, the piece is repeated with backward Euler, for which it does not.
template <typename Voltage>
WindingTick Windings::in_pieces(const Pieces& pieces, const Turn& turn, bool passive, const Voltage& voltage) const {
  if (quadrature_.unsaturated_h != 0.0) return in_saturated_pieces(pieces, turn, passive, voltage);
  const double angle = turn.angle / pieces.count;
  const double sine = std::sin(angle);
  const double cosine = std::cos(angle);
  const double sine_share = std::abs(angle) < 1.0e-4 ? 1.0 - angle * angle / 6.0 : sine / angle;
  const double cosine_share = std::abs(angle) < 1.0e-4 ? 0.5 * angle : (1.0 - cosine) / angle;
  const double flux_v = flux_ * pieces.count / drive::tick_seconds;
  Vector current{direct_a, quadrature_a};
  Vector mean;
  double square_a2 = 0.0;
  double power_w = 0.0;
  double torque_vs = 0.0;
  for (int i = 0; i < pieces.count; ++i) {
    const Vector start = current;
    const Vector old = turned(start, sine, cosine);
    const Vector linkage =
        turned({pieces.direct_rate * start.d + flux_v, pieces.quadrature_rate * start.q}, sine, cosine);
    const auto step = [&](double direct_weight, double quadrature_weight, bool again) {
      const Vector impedance{pieces.direct_rate + resistance_ * direct_weight,
                             pieces.quadrature_rate + resistance_ * quadrature_weight};
      const Vector kept{linkage.d - flux_v - resistance_ * (1.0 - direct_weight) * old.d,
                        linkage.q - resistance_ * (1.0 - quadrature_weight) * old.q};
      const Vector volts = voltage(sine, cosine, kept, impedance, again);
      current = {(kept.d + volts.d) / impedance.d, (kept.q + volts.q) / impedance.q};
      const Vector change = current - old;
      const Vector through{old.d + direct_weight * change.d, old.q + quadrature_weight * change.q};
      const double power = dot(volts, through);
      if (passive && !again && power > 0.0) return false;
      mean = mean + through;
      // The part of the energy that this integration takes from a strongly damped current, beyond the mean, is heat as
      // well.
      square_a2 += dot(through, through) + (pieces.direct_rate * (direct_weight - 0.5) * change.d * change.d +
                                            pieces.quadrature_rate * (quadrature_weight - 0.5) * change.q * change.q) /
                                               resistance_;
      power_w += power;
      torque_vs += flux_ * (sine_share * through.q + cosine_share * through.d) +
                   sine_share * 0.5 * saliency_ * (current.d * start.q + current.q * start.d);
      return true;
    };
    if (!step(pieces.direct_weight, pieces.quadrature_weight, false)) step(1.0, 1.0, true);
  }
  return mean_of({mean, current, square_a2, power_w, torque_vs}, pieces.count);
}

double Windings::Quadrature::magnetic_j(double current_a) const {
  const double share = std::abs(current_a) / scale_a;
  const double saturable = unsaturated_h == 0.0 ? 0.0 : scale_a * scale_a * (std::log1p(share) - share / (1.0 + share));
  return 0.5 * saturated_h * current_a * current_a + unsaturated_h * saturable;
}

double Windings::Quadrature::current_a(double flux_vs) const {
  // The positive root of saturated i^2 + ((saturated + unsaturated) scale - flux) i - flux scale = 0.
  const double flux = std::abs(flux_vs);
  const double linear = (saturated_h + unsaturated_h) * scale_a - flux;
  const double root = std::sqrt(linear * linear + 4.0 * saturated_h * flux * scale_a);
  return std::copysign(linear > 0.0 ? 2.0 * flux * scale_a / (linear + root) : (root - linear) / (2.0 * saturated_h),
                       flux_vs);
}

// A piece with saturation: the rotor turns by half of the angle, the voltage acts, the rotor turns by the other half
// (together with the first half of the next piece).
// Turning keeps the flux linkage of the stator, so its work is what the windings lose. In between, the mean current is
// that of the energy: change of the energy / change of the flux. So the energy balance is exact here too.
template <typename Voltage>
WindingTick Windings::in_saturated_pieces(const Pieces& pieces, const Turn& turn, bool passive,
                                          const Voltage& voltage) const {
  const double rate = pieces.count / drive::tick_seconds;
  const double angle = turn.angle / pieces.count;
  const double sine_half = std::sin(0.5 * angle);
  const double cosine_half = std::cos(0.5 * angle);
  const double sine = 2.0 * sine_half * cosine_half;
  const double cosine = cosine_half * cosine_half - sine_half * sine_half;
  Vector current{direct_a, quadrature_a};
  Vector linkage{direct_inductance_ * direct_a + flux_, quadrature_.flux_vs(quadrature_a)};
  double direct_j = 0.5 * direct_inductance_ * direct_a * direct_a;  // stored, per half phase
  double quadrature_j = quadrature_.magnetic_j(quadrature_a);
  Vector mean;
  double square_a2 = 0.0;
  double power_w = 0.0;
  double torque_vs = 0.0;
  const auto turn_by = [&](double turn_sine, double turn_cosine, double pieces_turned) {
    const Vector old_linkage = linkage;
    const Vector old = current;
    const double before_j = direct_j + quadrature_j;
    linkage = turned(linkage, turn_sine, turn_cosine);
    current = {(linkage.d - flux_) / direct_inductance_, quadrature_.current_a(linkage.q)};
    direct_j = 0.5 * direct_inductance_ * current.d * current.d;
    quadrature_j = quadrature_.magnetic_j(current.q);
    if (std::abs(angle) > 1.0e-8) {
      torque_vs += (before_j - (direct_j + quadrature_j)) / angle;
    } else {
      const Vector twice_linkage = old_linkage + linkage;
      const Vector twice_current = old + current;
      torque_vs += 0.25 * pieces_turned * (twice_linkage.d * twice_current.q - twice_linkage.q * twice_current.d);
    }
  };
  for (int i = 0; i < pieces.count; ++i) {
    const bool first = i == 0;
    const double turn_sine = first ? sine_half : sine;
    const double turn_cosine = first ? cosine_half : cosine;
    turn_by(turn_sine, turn_cosine, first ? 0.5 : 1.0);
    const Vector old = current;
    const double old_slope = 1.0 / quadrature_.slope_h(old.q);
    const auto step = [&](double direct_weight, double quadrature_weight, bool again) {
      const double more_weight = quadrature_weight - 0.5;
      const double zero_mean_q = (linkage.q == 0.0 ? 0.0 : quadrature_j / linkage.q) - more_weight * old.q;
      const Vector kept{rate * (linkage.d - flux_) - resistance_ * (1.0 - direct_weight) * old.d,
                        rate * linkage.q - resistance_ * zero_mean_q};
      const Vector impedance{pieces.direct_rate + resistance_ * direct_weight,
                             rate * quadrature_.inductance_h(old.q) + resistance_ * quadrature_weight};
      const Vector volts = voltage(turn_sine, turn_cosine, kept, impedance, again);
      Vector found{(kept.d + volts.d) / impedance.d, 0.0};
      double end_vs = 0.0;
      double end_j = 0.0;
      double mean_q = zero_mean_q;
      if (volts.q != -kept.q) {
        // Newton's method for the flux at the end, from an estimate with the present slope.
        end_vs = linkage.q + (volts.q - resistance_ * old.q) / (rate + resistance_ * quadrature_weight * old_slope);
        for (int pass = 0; pass < 20; ++pass) {
          found.q = quadrature_.current_a(end_vs);
          end_j = quadrature_.magnetic_j(found.q);
          const double change_vs = end_vs - linkage.q;
          const double per_flux = 1.0 / quadrature_.slope_h(found.q);
          const bool little = std::abs(change_vs) <= 1.0e-6 * (std::abs(linkage.q) + std::abs(end_vs));
          mean_q = little ? 0.5 * (old.q + found.q) : (end_j - quadrature_j) / change_vs;
          const double slope = (little ? 0.5 * per_flux : (found.q - mean_q) / change_vs) + more_weight * per_flux;
          mean_q += more_weight * (found.q - old.q);
          const double missed = rate * change_vs - volts.q + resistance_ * mean_q;
          const double correction = missed / (rate + resistance_ * slope);
          if (std::abs(correction) <= 1.0e-12 * (std::abs(end_vs) + std::abs(linkage.q))) break;
          end_vs -= correction;
        }
      }
      const Vector change = found - old;
      const Vector through{old.d + direct_weight * change.d, mean_q};
      const double power = dot(volts, through);
      if (passive && !again && power > 0.0) return false;
      mean = mean + through;
      square_a2 += dot(through, through) + (pieces.direct_rate * (direct_weight - 0.5) * change.d * change.d +
                                            rate * more_weight * change.q * (end_vs - linkage.q)) /
                                               resistance_;
      power_w += power;
      current = found;
      linkage = {direct_inductance_ * found.d + flux_, end_vs};
      direct_j = 0.5 * direct_inductance_ * found.d * found.d;
      quadrature_j = end_j;
      return true;
    };
    if (!step(pieces.direct_weight, pieces.quadrature_weight, false)) step(1.0, 1.0, true);
  }
  turn_by(sine_half, cosine_half, 0.5);
  return mean_of({mean, current, square_a2, power_w, torque_vs}, pieces.count);
}

WindingTick Windings::driven_in_pieces(double direct_v, double quadrature_v, const Turn& turn) const {
  Vector volts{direct_v, quadrature_v};
  const bool slow = std::abs(turn.angle) < 0.1 && resistance_ < 0.1 * whole_.direct_rate;
  return in_pieces(slow ? whole_ : pieces_, turn, false, [&](double sine, double cosine, Vector, Vector, bool) {
    return volts = turned(volts, sine, cosine);
  });
}

// For each piece there is one voltage with which the current is zero at its end. If the bridge can make this voltage,
// the diodes block, and the windings have this voltage. Otherwise the bridge makes the voltage that leaves the least
// energy.
WindingTick Windings::freewheeling(double dc_link_v, double sine, double cosine, const Turn& turn) const {
  const double emf_v = std::abs(turn.angle / drive::tick_seconds * flux_);
  if (direct_a == 0.0 && quadrature_a == 0.0 && emf_v <= dc_link_v * bridge_share_) return {};
  Vector phase_u{cosine, -sine};
  return in_pieces(pieces_, turn, true,
                   [&](double turn_sine, double turn_cosine, Vector kept, Vector impedance, bool again) {
                     if (!again) phase_u = turned(phase_u, turn_sine, turn_cosine);
                     const DiodeBridge bridge(phase_factor_ == 1.0, dc_link_v, phase_u);
                     return bridge.nearest(-1.0 * kept, {1.0 / impedance.d, 1.0 / impedance.q});
                   });
}

}  // namespace servodrome::plant
