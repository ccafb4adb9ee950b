#include "plant/axis_coupling.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace servodrome::plant {

AxisCoupling::AxisCoupling(const CouplingParameters& parameters, Plant& first, Plant& second)
    : parameters_(parameters), first_{first}, second_{second} {
  const auto messages = validate(parameters, first.parameters(), second.parameters());
  if (!messages.empty()) throw std::invalid_argument(messages.front());
  first.couple();
  second.couple();
  relax();
}

void AxisCoupling::relax() {
  for (Side* side : {&first_, &second_}) side->relaxed_counts = side->plant.position_counts();
  relaxed_rad_ = difference_rad();
}

void AxisCoupling::pull() {
  const double rate = first_.plant.load_speed_rad_s() - parameters_.ratio * second_.plant.load_speed_rad_s();
  const double twist = twist_rad() + 0.5 * drive::tick_seconds * rate;
  const double half_play = 0.5 * parameters_.backlash_rad;
  double torque_nm = 0.0;
  if (half_play == 0.0) {
    torque_nm = parameters_.stiffness_nm_per_rad * twist + parameters_.damping_nms * rate;
  } else if (std::abs(twist) > half_play) {  // a flank pushes and never pulls
    const double side = std::copysign(1.0, twist);
    const double overlap = std::abs(twist) - half_play;
    torque_nm =
        side * std::max(0.0, parameters_.stiffness_nm_per_rad * overlap + parameters_.damping_nms * side * rate);
  }
  first_.plant.pull(-torque_nm);
  second_.plant.pull(parameters_.ratio * torque_nm);
}

double AxisCoupling::twist_rad() const { return difference_rad() - relaxed_rad_; }

double AxisCoupling::stored_j() const {
  const double overlap = std::max(0.0, std::abs(twist_rad()) - 0.5 * parameters_.backlash_rad);
  return 0.5 * parameters_.stiffness_nm_per_rad * overlap * overlap;
}

}  // namespace servodrome::plant
