#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "catalogue/object_address.hpp"

// Differences between a product's drives and CiA 402 that a master must know to move the axes.
namespace servodrome::catalogue {

// Statusword bits that report the result of homing.
struct HomingSignals {
  std::uint16_t attained = 1U << 12;
  std::uint16_t error = 1U << 13;
  bool target_reached = true;  // homing is complete only when bit 10 (target reached) is set as well
};

// The effect of 607Ch at the end of homing.
struct HomeOffset {
  bool travels = false;  // the axis travels by 607Ch and shows 0 there; otherwise it stays, and 607Ch shifts the zero
  // With 1 in this UINT8 object the axis stays.
  std::optional<ObjectAddress> stays_with_1{};
};

// One motor revolution, one revolution/s and one revolution/s2, in the drive's units.
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

// A word with a bit for each active alarm: bit n is the product's alarm number `first_alarm` + n.
struct AlarmWord {
  ObjectAddress object;
  std::uint16_t first_alarm;
};

// An object that a master writes in addition to 60C2h before it sends targets in a fixed period.
struct CycleObject {
  ObjectAddress object;
  std::uint8_t bytes = 0;
  std::int64_t (*value_of)(std::chrono::nanoseconds period) = nullptr;
};

struct Dialect {
  HomingSignals homing_signals{};
  HomeOffset home_offset{};
  // nullopt: the drive reports its position unit (6091h and 6092h, or 608Fh), and velocities are position units/s.
  std::optional<AxisUnits> units{};
  // The object with the counts of the encoder in a revolution, which replace `units.position`. If the drive does not
  // have the object, the unit is unknown.
  std::optional<ObjectAddress> encoder_counts{};
  // `units` apply before the factors 6093h, 6094h and 6097h (1998 edition of CiA 402).
  bool has_old_factors = false;
  // A homing method that turns the motor by at most one revolution and needs no switch.
  std::int8_t cautious_homing_method = 34;
  SoftwareLimitSubs software_limits{};
  // The UINT16 object with the milliseconds in which the brake closes before the drive switches off.
  std::optional<ObjectAddress> brake_delay{};
  // 607Bh is the range in which positions wrap around.
  bool has_position_range = true;
  // A halt discards the target; to continue the move, the master must send the target again.
  bool halt_drops_target = false;
  std::span<const CycleObject> cycle_objects{};
  std::string_view foe_file{};  // a file that FoE can read
  std::span<const AlarmWord> alarm_words{};
  // Alarm log: `alarm_log_length` consecutive objects from this index, each with an alarm number or error code, the
  // newest first.
  std::uint16_t alarm_log = 0;
  std::uint8_t alarm_log_length = 0;
};

}  // namespace servodrome::catalogue
