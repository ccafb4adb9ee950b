#pragma once

#include "plant/parameters.hpp"

namespace servodrome::plant {

// The properties of the load that depend on its place: the weight of an arm or a crank's slider, the inertia of that
// slider, and the stiffness of a belt.
class Geometry {
 public:
  explicit Geometry(const Load& load);

  struct Point {
    double weight_nm;     // pulls towards smaller counts
    double weight_j;      // potential energy of that weight
    double inertia_kgm2;  // of the whole load
    double stiffness_nm_per_rad;
    double stiffness_slope;  // its change per rad of the load
  };

  bool varies() const { return cycle_ || belt_; }
  Point at(double revolutions) const;  // of the motor, from encoder count 0

 private:
  bool cycle_;
  bool belt_;
  Load load_;
};

}  // namespace servodrome::plant
