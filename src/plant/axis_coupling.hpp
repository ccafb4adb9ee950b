#pragma once

#include <cstdint>

#include "plant/parameters.hpp"
#include "plant/plant.hpp"

namespace servodrome::plant {

// Couples the loads of two plants. pull() before each tick of both gives them equal and opposite torques for this tick,
// so the order in which the two plants step then has no effect.
//
// The present speeds predict the twist in the middle of the tick, and the torque is that of this twist. With it the
// tick is a leapfrog step: it conserves the momentum exactly and the energy of a vibration on average, and the
// vibration has the frequency 2 asin(w h / 2) / h in place of w. validate() limits w h to 1; a step with w h above 2
// would be unstable.
class AxisCoupling {
 public:
  // The coupling is relaxed at the present places of both axes. The plants must outlive it.
  AxisCoupling(const CouplingParameters& parameters, Plant& first, Plant& second);

  void pull();
  // Relaxes the coupling at the present places of both axes, in the middle of its play.
  void relax();

  const CouplingParameters& parameters() const { return parameters_; }
  double twist_rad() const;  // first shaft minus ratio * second
  double stored_j() const;   // energy in the spring

 private:
  struct Side {
    Plant& plant;
    std::int64_t relaxed_counts = 0;
    double angle_rad() const { return plant.load_angle_rad(relaxed_counts); }
  };
  double difference_rad() const { return first_.angle_rad() - parameters_.ratio * second_.angle_rad(); }

  CouplingParameters parameters_;
  Side first_;
  Side second_;
  double relaxed_rad_ = 0.0;  // difference_rad() without twist
};

}  // namespace servodrome::plant
