#include "plant/doubts.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "drive/hardware.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {

constexpr double rad_s_per_rpm = std::numbers::pi / 30.0;
constexpr double nameplate_share = 1.03;        // rounding in data sheets
constexpr double fastest_stop_rad_s = 2.0e6;    // see decision 19
constexpr double fastest_vibration_rad = 1.0;   // angle per tick; a faster vibration is damped
constexpr double largest_electrical_rad = 1.0;  // angle per tick; a current loop needs less

template <typename... Values>
std::string text(const char* format, Values... values) {
  std::array<char, 256> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, values...);
  return buffer.data();
}

}  // namespace

std::vector<std::string> doubts(const Parameters& p) {
  std::vector<std::string> messages;
  const Motor& motor = p.motor;
  const Load& load = p.load;
  const double torque_nm = motor.torque_constant_nm_per_a * motor.rated_current_a;
  if (motor.rated_torque_nm > nameplate_share * torque_nm) {
    messages.push_back(text("motor.rated_torque_nm: %.3g Nm is more than torque constant and rated current make, %.3g",
                            motor.rated_torque_nm, torque_nm));
  }
  const double electrical = motor.pole_pairs * motor.rated_speed_rpm * rad_s_per_rpm;
  if (electrical * h > largest_electrical_rad) {
    messages.push_back(
        text("motor.rated_speed_rpm: with %d pole pairs the field turns by %.2g rad in a base tick, more "
             "than a drive of 16 kHz can hold",
             motor.pole_pairs, electrical * h));
  }
  // Between two of three phases; each of two windings has its own bridge.
  const double emf_v = electrical * flux_linkage_vs(motor) * (motor.phases == 3 ? std::numbers::sqrt3 : 1.0);
  if (emf_v > p.supply.volts) {
    messages.push_back(
        text("motor.torque_constant_nm_per_a: the back-EMF at rated speed has a peak of %.3g V, beyond the "
             "DC link's %.3g V",
             emf_v, p.supply.volts));
  }
  const double both = motor.rotor_inertia_kgm2 + load.inertia_kgm2;
  if (load.elastic) {
    const double reduced = motor.rotor_inertia_kgm2 * load.inertia_kgm2 / both;
    const double vibration = std::sqrt(load.stiffness_nm_per_rad / reduced);
    if (vibration * h > fastest_vibration_rad) {
      messages.push_back(
          text("load.stiffness_nm_per_rad: rotor and load would vibrate at %.3g Hz, which the base tick "
               "does not show: it is damped away",
               vibration / (2.0 * std::numbers::pi)));
    }
  }
  const bool stops = load.low_stop_counts != no_low_limit || load.high_stop_counts != no_high_limit;
  const double bounce = std::sqrt(load.stop_stiffness_nm_per_rad / (load.elastic ? load.inertia_kgm2 : both));
  if (stops && bounce > fastest_stop_rad_s) {
    messages.push_back(
        text("load.stop_stiffness_nm_per_rad: a rebound within %.2g us, which no piece of a tick shows: the "
             "load comes back slower than the stop's damping says",
             std::numbers::pi / bounce * 1.0e6));
  }
  return messages;
}

}  // namespace servodrome::plant
