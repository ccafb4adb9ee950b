#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "drive/loops/motor_data.hpp"
#include "drive/objects.hpp"
#include "drive/units.hpp"

// The internal units ("DEC") of the iSMK (ch. 7.2 and 7.3, appendix II). With R increments per revolution
//   velocity      rpm x 512 x R / 1875            = inc/s x 16.384
//   acceleration  rps/s x 65536 x R / 4000000     = inc/s^2 x 0.016384
//   current       2048 is the drive's peak current (6510h sub 3)
// and positions are increments. Conversions round to the nearest, as all printed examples do.
namespace servodrome::products::ismk {

inline constexpr double velocity_dec_per_inc_s = 16.384;
inline constexpr double acceleration_dec_per_inc_s2 = 0.016384;
inline constexpr double peak_current_dec = 2048.0;
inline constexpr double encoder_resolution = 65536.0;

constexpr double velocity_dec_from_rpm(double rpm) { return rpm * 512.0 * encoder_resolution / 1875.0; }
constexpr double rpm_from_velocity_dec(double dec) { return dec * 1875.0 / (512.0 * encoder_resolution); }
constexpr double acceleration_dec_from_rps_s(double rps_s) { return rps_s * 65536.0 * encoder_resolution / 4000000.0; }

// Rounds to the nearest value of the type.
template <typename Integer>
Integer rounded(double value) {
  constexpr auto low = static_cast<double>(std::numeric_limits<Integer>::min());
  constexpr auto high = static_cast<double>(std::numeric_limits<Integer>::max());
  return static_cast<Integer>(std::llround(std::clamp(value, low, high)));
}

// The motor must carry the drive's peak current in `peak_current_a`.
inline bool units(const drive::Objects& objects, const drive::MotorData& motor, drive::Units& units) {
  units = {};
  units.velocity = 1.0 / velocity_dec_per_inc_s;
  units.acceleration = 1.0 / acceleration_dec_per_inc_s2;
  units.jerk = units.acceleration;
  units.counts_per_revolution = motor.counts_per_revolution;
  units.current = static_cast<double>(motor.peak_current_a / motor.rated_current_a) / peak_current_dec;
  units.position_inverted = units.velocity_inverted = objects.polarity != 0;  // 1: clockwise positive
  return true;
}

}  // namespace servodrome::products::ismk
