#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "drive/policy.hpp"
#include "drive/units.hpp"
#include "line/config.hpp"
#include "line/registry.hpp"
#include "sequence.hpp"

// The variants that are tested: every product in every size, with the data that a master needs to choose sensible
// numbers for it.
namespace servodrome::motion {

struct Variant {
  const line::Product* product = nullptr;
  std::string model;     // empty: the product has no sizes
  drive::Units units{};  // counts per unit of the drive, from the factory
  double max_speed_rpm = 0.0;
  std::uint32_t modes = 0;  // drive::mode_bit()
  bool records = false;     // interpolated position follows 60C1h, not 607Ah
  std::vector<std::uint16_t> homing_methods;
  std::vector<std::uint16_t> objects;  // those of the optional objects that it has

  bool has(drive::Mode mode) const { return (modes & drive::mode_bit(mode)) != 0; }
  bool has_object(std::uint16_t index) const {
    return std::find(objects.begin(), objects.end(), index) != objects.end();
  }
  bool on_ethercat() const { return product->fieldbus == line::Fieldbus::ethercat; }
  // Convert motor revolutions, revolutions per s and revolutions per s^2 to units of the drive.
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

// All variants, or those of one product.
std::vector<Variant> variants(std::string_view product = {});

// The settings of the line on which a sequence runs: its axes, and a bus of each kind that they need.
line::LineSettings line_settings(const Sequence& sequence);

}  // namespace servodrome::motion
