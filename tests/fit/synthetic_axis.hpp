#pragma once

#include <cmath>

#include "fit_rig.hpp"

// An axis whose recording follows from formulas: the speed is given; torque, current and voltages are calculated from
// it.
namespace servodrome::fit::test {

struct SyntheticAxis {
  double resistance_ohm = 1.2;
  double direct_h = 4e-3;
  double quadrature_h = 4e-3;
  double voltage_constant = 0.22;  // V of amplitude per rad/s
  double inertia_kgm2 = 2e-4;
  double coulomb_nm = 0.05;
  double viscous_nms = 2e-4;
  double weight_nm = -0.1;
  double drop_v = 0.0;    // voltage drop of the stage, in the direction of the current
  double direct_a = 0.0;  // amplitude of a direct current that rises and falls
  double delay_s = 0.0;   // delay of the current behind the voltage; the drive rotates its voltages accordingly
  double warmth_k = 0.0;  // temperature rise of the winding per second
  int pole_pairs = 4;
  double phases_half = 1.5;
  double speed_rad_s = 200.0;
  double offset_rad_s = 0.0;  // above the greatest speed: the axis moves in one direction only
  double rate_hz = 4000.0;
  double duration_s = 2.0;

  double speed(double t) const {
    return offset_rad_s + speed_rad_s * (0.7 * std::sin(6.283 * t) + 0.3 * std::sin(41.0 * t + 1.0));
  }
  double acceleration(double t) const {
    return speed_rad_s * (0.7 * 6.283 * std::cos(6.283 * t) + 0.3 * 41.0 * std::cos(41.0 * t + 1.0));
  }
  double angle(double t) const {
    return offset_rad_s * t - speed_rad_s * (0.7 / 6.283 * std::cos(6.283 * t) + 0.3 / 41.0 * std::cos(41.0 * t + 1.0));
  }
  double torque(double t) const {
    const double slow = 1.0;  // speed range in rad/s in which friction changes its sign
    return inertia_kgm2 * acceleration(t) + viscous_nms * speed(t) + coulomb_nm * std::tanh(speed(t) / slow) +
           weight_nm;
  }
  double direct(double t) const { return direct_a * std::sin(17.0 * t) * std::sin(17.0 * t); }
  double quadrature(double t) const {
    return torque(t) / (phases_half * (voltage_constant + pole_pairs * (direct_h - quadrature_h) * direct(t)));
  }
  double resistance(double t) const { return resistance_ohm * (1.0 + 3.93e-3 * warmth_k * t); }
  template <typename Function>
  static double slope(Function function, double t) {
    constexpr double step = 1e-6;
    return (function(t + step) - function(t - step)) / (2.0 * step);
  }

  Signals signals() const {
    Signals made{.source = "synthetic", .seconds = {}, .values = {}, .columns = {}, .why_not = {}, .remarks = {}};
    const auto put = [&](Role role, double value) { made.values[static_cast<std::size_t>(role)].push_back(value); };
    for (double i = 0; i < duration_s * rate_hz; ++i) {
      const double t = i / rate_hz;
      made.seconds.push_back(t);
      put(Role::position, angle(t));
      put(Role::velocity, speed(t));
      put(Role::quadrature_current, quadrature(t));
      put(Role::direct_current, direct(t));
      const double later = t + delay_s;
      const double id = direct(later);
      const double iq = quadrature(later);
      const double all = std::hypot(id, iq) + 1e-9;
      const double electrical = pole_pairs * speed(later);
      put(Role::quadrature_voltage,
          resistance(later) * iq + quadrature_h * slope([&](double x) { return quadrature(x); }, later) +
              electrical * direct_h * id + voltage_constant * speed(later) + drop_v * iq / all);
      put(Role::direct_voltage, resistance(later) * id + direct_h * slope([&](double x) { return direct(x); }, later) -
                                    electrical * quadrature_h * iq + drop_v * id / all);
      if (warmth_k != 0.0) put(Role::temperature, 25.0 + warmth_k * t);
    }
    return made;
  }
  Motor motor() const {
    Motor made;
    made.pole_pairs = pole_pairs;
    made.phases = static_cast<int>(2.0 * phases_half);
    return made;
  }
  double torque_constant() const { return phases_half * voltage_constant * std::sqrt(2.0); }
};

inline void forget(Signals& signals, std::initializer_list<Role> roles) {
  for (const Role role : roles) signals.values[static_cast<std::size_t>(role)].clear();
}

}  // namespace servodrome::fit::test
