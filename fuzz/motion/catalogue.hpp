#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "drive/policy.hpp"
#include "drive/units.hpp"
#include "line/config.hpp"
#include "line/registry.hpp"
#include "sequence.hpp"

// What there is to be tried: every product in every size, and what a master has to know of each to give it sensible
// numbers.
namespace servodrome::motion {

struct Variant {
  const line::Product* product = nullptr;
  std::string model;     // empty: the product has no sizes
  drive::Units units{};  // counts per unit of the drive, from the factory
  double max_speed_rpm = 0.0;
  std::uint32_t modes = 0;  // drive::mode_bit()
  bool records = false;     // interpolated position follows 60C1h, not 607Ah
  std::vector<std::uint16_t> homing_methods;
  std::vector<std::uint16_t> objects;  // which it has of those that not every product has

  bool has(drive::Mode mode) const { return (modes & drive::mode_bit(mode)) != 0; }
  bool has_object(std::uint16_t index) const {
    return std::find(objects.begin(), objects.end(), index) != objects.end();
  }
  bool on_ethercat() const { return product->fieldbus == line::Fieldbus::ethercat; }
  // Units of the drive for motor revolutions, and for revolutions per s and per s^2.
  double position(double revolutions) const {
    return revolutions * units.counts_per_revolution / units.position.value();
  }
  double velocity(double revolutions_per_s) const {
    return revolutions_per_s * units.counts_per_revolution / units.velocity;
  }
  double acceleration(double revolutions_per_s2) const {
    return revolutions_per_s2 * units.counts_per_revolution / units.acceleration;
  }
};

// All of them, or those of one product.
std::vector<Variant> variants(std::string_view product = {});

// The variants with the fieldbus of the product of `first`, so that they can share a line.
line::LineSettings line_settings(const Sequence& sequence);

}  // namespace servodrome::motion
