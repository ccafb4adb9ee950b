#include "plant/geometry.hpp"

#include <algorithm>
#include <cmath>

#include "plant/step.hpp"

namespace servodrome::plant {

namespace {
constexpr double end_of_belt = 0.9;  // share of the half length from which on the stiffness stays
}  // namespace

Geometry::Geometry(const Load& load)
    : cycle_(load.arm_torque_nm != 0.0 || load.crank_inertia_kgm2 != 0.0 || load.crank_torque_nm != 0.0),
      belt_(load.elastic && load.belt_length_revolutions > 0.0),
      load_(load) {}

Geometry::Point Geometry::at(double revolutions) const {
  Point point{0.0, 0.0, load_.inertia_kgm2, load_.stiffness_nm_per_rad, 0.0};
  if (cycle_) {
    const double turns = revolutions / load_.cycle_revolutions + load_.cycle_offset_turns;
    const double angle = two_pi * (turns - std::floor(turns));
    const double sine = std::sin(angle);
    const double cosine = std::cos(angle);
    // The slider moves by its radius times this, per rad of the crank; the rod adds the second harmonic.
    const double slide = sine + load_.crank_ratio * sine * cosine;
    point.weight_nm = load_.arm_torque_nm * cosine + load_.crank_torque_nm * slide;
    point.weight_j =
        load_.cycle_revolutions *
        (load_.arm_torque_nm * sine + load_.crank_torque_nm * (0.5 * load_.crank_ratio * sine * sine - cosine));
    point.inertia_kgm2 += load_.crank_inertia_kgm2 * slide * slide;
  }
  if (belt_) {
    // Two springs in parallel, each with a stiffness in inverse proportion to its length.
    const double per_half = 2.0 / load_.belt_length_revolutions;
    const double off_middle = (revolutions - load_.belt_middle_revolutions) * per_half;
    const double share = std::clamp(off_middle, -end_of_belt, end_of_belt);
    const double gain = 1.0 / (1.0 - share * share);
    point.stiffness_nm_per_rad *= gain;
    if (share == off_middle)
      point.stiffness_slope = point.stiffness_nm_per_rad * gain * 2.0 * share * per_half / two_pi;
  }
  return point;
}

}  // namespace servodrome::plant
