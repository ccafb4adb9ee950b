#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "host/object_address.hpp"
#include "links/time.hpp"

// How a product's drives differ from CiA 402 in what a master must know to move them.
namespace servodrome::host {

// What the statusword says about homing.
struct HomingSignals {
  std::uint16_t attained = 1U << 12;
  std::uint16_t error = 1U << 13;
  bool target_reached = true;  // it is attained when bit 10 is set as well
};

// A motor revolution, one per second, and one per second squared, in a drive's units.
struct AxisUnits {
  double position;
  double velocity;
  double acceleration;
};

// Sub-indices of 607Dh.
struct SoftwareLimitSubs {
  std::uint8_t lowest = 1;
  std::uint8_t highest = 2;
};

// A word whose bits are alarms that are there: bit n is the product's alarm number `first_alarm` + n.
struct AlarmWord {
  ObjectAddress object;
  std::uint16_t first_alarm;
};

// An object beside 60C2h that a master writes before it gives targets in a fixed period.
struct CycleObject {
  ObjectAddress object;
  std::uint8_t bytes = 0;
  std::int64_t (*value_of)(links::Time period) = nullptr;
};

struct Dialect {
  std::string_view product{};  // as `servodrome products` lists it
  HomingSignals homing_signals{};
  // Nothing: the drive says what a position unit is (6091h and 6092h, or 608Fh), and velocities are position units/s.
  std::optional<AxisUnits> units{};
  // Where the drive tells the counts of its encoder in a revolution: `units.position` is that number. Of a drive that
  // has no such object it is not known.
  std::optional<ObjectAddress> encoder_counts{};
  // `units` are before the factors 6093h, 6094h and 6097h of the 1998 edition of CiA 402.
  bool has_old_factors = false;
  // Moves the motor by a revolution at most, and needs no switch.
  std::int8_t cautious_homing_method = 34;
  SoftwareLimitSubs software_limits{};
  // A halt drops the target: to go on, it is given again.
  bool halt_drops_target = false;
  std::span<const CycleObject> cycle_objects{};
  std::string_view foe_file{};  // that can be read by FoE
  std::span<const AlarmWord> alarm_words{};
  // Objects, one after another from this index, with what an alarm log keeps: alarm number or code, the newest first.
  std::uint16_t alarm_log = 0;
  std::uint8_t alarm_log_length = 0;
};

// By the product's name; that of CiA 402 for one that is not in the table.
const Dialect& dialect_of(std::string_view product);

}  // namespace servodrome::host
