#pragma once

#include "plant/parameters.hpp"

namespace servodrome::plant::test {

// A hybrid stepper of size NEMA 34: two windings in quadrature, 200 full steps per revolution.
inline void make_stepper(Motor& motor) {
  motor.phases = 2;
  motor.pole_pairs = 50;
  motor.rated_torque_nm = 4.4;
  motor.rated_current_a = 6.0;
  motor.resistance_ohm = 0.4;
  motor.direct_inductance_h = motor.quadrature_inductance_h = 2.3e-3;
  motor.torque_constant_nm_per_a = 0.74;
  motor.rotor_inertia_kgm2 = 1.4e-4;
}

}  // namespace servodrome::plant::test
