#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

// The voltages across the windings, in the rotor frame, that six diodes can make while all switches are open. They form
// a polygon. On its corners three diodes conduct, on its sides two, inside it none. A star of three phases gives the
// hexagon of the DC link; two windings with one bridge each give its square.
namespace servodrome::plant {

struct Vector {
  double d = 0.0;
  double q = 0.0;
};

inline Vector operator+(Vector a, Vector b) { return {a.d + b.d, a.q + b.q}; }
inline Vector operator-(Vector a, Vector b) { return {a.d - b.d, a.q - b.q}; }
inline Vector operator*(double a, Vector b) { return {a * b.d, a * b.q}; }
inline double dot(Vector a, Vector b) { return a.d * b.d + a.q * b.q; }

class DiodeBridge {
 public:
  // `phase_u` is the direction of phase U in the rotor frame.
  DiodeBridge(bool two_phases, double dc_link_v, Vector phase_u) : empty_(dc_link_v < 1.0e-6) {
    const Vector across{-phase_u.q, phase_u.d};
    if (two_phases) {
      const Vector u = dc_link_v * phase_u;
      const Vector v = dc_link_v * across;
      corners_ = {u + v, v - u, -1.0 * (u + v), u - v};
      count_ = 4;
    } else {
      const Vector u = 2.0 / 3.0 * dc_link_v * phase_u;
      const Vector opposite_w = 0.5 * u + 0.57735026918962576 * dc_link_v * across;
      corners_ = {u, opposite_w, opposite_w - u, -1.0 * u, -1.0 * opposite_w, u - opposite_w};
      count_ = 6;
    }
  }

  // Returns `point` if it lies in the polygon, else the nearest point of it. `weights` scale the squares of both axes
  // in the distance.
  Vector nearest(Vector point, Vector weights) const {
    const auto product = [weights](Vector a, Vector b) { return weights.d * a.d * b.d + weights.q * a.q * b.q; };
    Vector best;
    if (empty_) return best;
    double least = -1.0;
    bool inside = true;
    for (std::size_t i = 0; i < count_; ++i) {
      const Vector from = corners_[i];
      const Vector side = corners_[i + 1 == count_ ? 0 : i + 1] - from;
      const Vector to_point = point - from;
      inside = inside && side.d * to_point.q - side.q * to_point.d >= 0.0;
      const double square = product(side, side);
      const double share = square > 0.0 ? std::clamp(product(to_point, side) / square, 0.0, 1.0) : 0.0;
      const Vector missed = to_point - share * side;
      const double distance = product(missed, missed);
      if (least >= 0.0 && distance >= least) continue;
      least = distance;
      best = from + share * side;
    }
    return inside ? point : best;
  }

 private:
  std::array<Vector, 6> corners_{};  // counter-clockwise
  std::size_t count_;
  bool empty_;  // no DC link voltage: the diodes short the windings
};

}  // namespace servodrome::plant
