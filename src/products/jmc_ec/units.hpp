#pragma once

#include "drive/loops/motor_data.hpp"
#include "drive/objects.hpp"
#include "drive/units.hpp"

namespace servodrome::products::jmc_ec {

inline constexpr std::int64_t greatest_gear = 1000;  // and its inverse ('Electronic gear')

// internal position = command position x (608Fh:1 / 608Fh:2) x (6091h:1 / 6091h:2) / (6092h:1 / 6092h:2) ('Electronic
// gear'). False for a ratio outside of 1/1000 to 1000: AL.105.
inline bool units(const drive::Objects& objects, const drive::MotorData& motor, drive::Units& units) {
  const drive::Ratio resolution{objects.position_encoder_increments, objects.position_encoder_motor_revolutions};
  const drive::Ratio gear{objects.gear_motor_revolutions, objects.gear_shaft_revolutions};
  const drive::Ratio feed{objects.feed, objects.feed_shaft_revolutions};
  if (!resolution.valid() || !gear.valid() || !feed.valid()) return false;
  const drive::Ratio motor_side = resolution * gear;
  if (!motor_side.valid()) return false;
  const drive::Ratio ratio = motor_side * feed.inverse();
  if (!ratio.valid()) return false;
  if (ratio.numerator > greatest_gear * ratio.denominator || ratio.denominator > greatest_gear * ratio.numerator) {
    return false;
  }
  constexpr unsigned inverted_velocity = 1U << 6;
  constexpr unsigned inverted_position = 1U << 7;
  units = {};
  units.position = ratio;
  units.velocity = units.acceleration = units.jerk = ratio.value();
  units.counts_per_revolution = motor.counts_per_revolution;
  units.position_inverted = (objects.polarity & inverted_position) != 0;
  units.velocity_inverted = (objects.polarity & inverted_velocity) != 0;
  return true;
}

}  // namespace servodrome::products::jmc_ec
