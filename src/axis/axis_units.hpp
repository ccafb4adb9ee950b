#pragma once

#include <array>
#include <compare>
#include <optional>
#include <string>
#include <string_view>

#include "catalogue/dialect.hpp"

// Units in which users enter and read the positions, velocities and accelerations of an axis.
namespace servodrome::master {

using catalogue::AxisUnits;

class Axis402;

enum class UnitSystem : std::uint8_t { drive, counts, revolutions, rpm, degrees, millimetres };

// Names of the units, and the number of decimals to display.
struct UnitNames {
  UnitSystem system;
  std::string_view word;  // keyword that selects the system
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
// nullopt: there is no system of that name.
std::optional<UnitSystem> unit_system_named(std::string_view word);
// "drive, counts, revolutions ...": all names, for messages.
std::string list_of_unit_systems();

struct UnitChoice {
  UnitSystem system = UnitSystem::drive;
  std::optional<double> units_per_revolution{};  // position units of the drive in a motor revolution; nullopt: read
                                                 // from the drive
  std::optional<double> feed_mm{};               // travel in a motor revolution; for millimetres only

  auto operator<=>(const UnitChoice&) const = default;
};

// The drive's units in one unit of the chosen system. of() throws MasterError if the drive does not report what the
// conversion needs.
struct UnitScale {
  UnitSystem system = UnitSystem::drive;
  AxisUnits drive{1.0, 1.0, 1.0};

  // `how` goes into the error message: how the user supplies the value that the drive does not report.
  static UnitScale of(Axis402& axis, const UnitChoice& choice, const std::string& how);

  // For example "1.50000 rev"; in the drive's own units only the number.
  std::string position(std::int32_t in_drive_units) const;
  std::string velocity(std::int32_t in_drive_units) const;
};

}  // namespace servodrome::master
