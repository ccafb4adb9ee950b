#pragma once

#include <array>
#include <compare>
#include <optional>
#include <string>
#include <string_view>

#include "host/dialect.hpp"

// In what people give and read the positions, velocities and accelerations of an axis.
namespace servodrome::host {

class Axis402;

enum class UnitSystem : std::uint8_t { drive, counts, revolutions, rpm, degrees, millimetres };

// Names, and digits behind the point that a person wants to see.
struct UnitNames {
  UnitSystem system;
  std::string_view word;  // as it is chosen by
  std::string_view position;
  std::string_view velocity;
  std::string_view acceleration;
  int position_digits;
  int velocity_digits;
};

inline constexpr std::array unit_names{
    UnitNames{UnitSystem::drive, "drive", "", "", "", 0, 0},
    UnitNames{UnitSystem::counts, "counts", "counts", "counts/s", "counts/s2", 0, 0},
    UnitNames{UnitSystem::revolutions, "revolutions", "rev", "rev/s", "rev/s2", 5, 4},
    UnitNames{UnitSystem::rpm, "rpm", "rev", "rpm", "rpm/s", 5, 2},
    UnitNames{UnitSystem::degrees, "degrees", "deg", "deg/s", "deg/s2", 3, 2},
    UnitNames{UnitSystem::millimetres, "mm", "mm", "mm/s", "mm/s2", 4, 3},
};
const UnitNames& names_of(UnitSystem system);
// Nothing: there is no such word.
std::optional<UnitSystem> unit_system_named(std::string_view word);
// "drive, counts, revolutions ...".
std::string list_of_unit_systems();

struct UnitChoice {
  UnitSystem system = UnitSystem::drive;
  std::optional<double> units_per_revolution{};  // of position, of the drive; nothing: the drive is asked
  std::optional<double> feed_mm{};               // what a motor revolution moves; for millimetres

  auto operator<=>(const UnitChoice&) const = default;
};

// How many of the drive's units are one of the chosen. Throws HostError if the drive does not say what is needed.
struct UnitScale {
  UnitSystem system = UnitSystem::drive;
  AxisUnits drive{1.0, 1.0, 1.0};

  // `how` a person says what the drive does not, for the message.
  static UnitScale of(Axis402& axis, const UnitChoice& choice, const std::string& how);

  // "1.50000 rev"; of the drive's own units the number alone.
  std::string position(std::int32_t in_drive_units) const;
  std::string velocity(std::int32_t in_drive_units) const;
};

}  // namespace servodrome::host
