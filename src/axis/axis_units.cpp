#include "axis/axis_units.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "axis/axis402.hpp"

namespace servodrome::master {
namespace {

AxisUnits times(const AxisUnits& units, double factor) {
  return {units.position * factor, units.velocity * factor, units.acceleration * factor};
}

std::string number_with_unit(double number, int digits, std::string_view unit) {
  const std::string text = fmt::format("{:.{}f}", number, digits);
  return unit.empty() ? text : fmt::format("{} {}", text, unit);
}

}  // namespace

const UnitNames& names_of(UnitSystem system) { return unit_names[static_cast<std::size_t>(system)]; }

std::optional<UnitSystem> unit_system_named(std::string_view word) {
  const auto* const found =
      std::find_if(unit_names.begin(), unit_names.end(), [word](const UnitNames& names) { return names.word == word; });
  return found != unit_names.end() ? std::optional(found->system) : std::nullopt;
}

std::string list_of_unit_systems() {
  std::string list;
  for (const UnitNames& names : unit_names) list += fmt::format("{}{}", list.empty() ? "" : ", ", names.word);
  return list;
}

UnitScale UnitScale::of(Axis402& axis, const UnitChoice& choice, const std::string& how) {
  if (choice.system == UnitSystem::drive) return {};
  if (choice.system == UnitSystem::counts) {
    if (const auto units = axis.units_per_count()) return {choice.system, *units};
    throw MasterError("the drive does not report the counts per revolution of its encoder (608Fh)",
                      axis.objects().where(), "give the numbers in the drive's units");
  }
  const auto revolution = axis.units(choice.units_per_revolution);
  if (!revolution) {
    throw MasterError("the drive does not report its units per revolution (6092h, 608Fh)", axis.objects().where(),
                      how + ", or give the numbers in the drive's units");
  }
  constexpr double seconds_of_minute = 60.0;
  constexpr double degrees_of_revolution = 360.0;
  switch (choice.system) {
    case UnitSystem::rpm:
      return {choice.system,
              {revolution->position, revolution->velocity / seconds_of_minute,
               revolution->acceleration / seconds_of_minute}};
    case UnitSystem::degrees: return {choice.system, times(*revolution, 1.0 / degrees_of_revolution)};
    case UnitSystem::millimetres:
      if (!choice.feed_mm)
        throw MasterError("units in mm need the feed per motor revolution", axis.objects().where(),
                          "give the feed in mm");
      return {choice.system, times(*revolution, 1.0 / *choice.feed_mm)};
    default: return {choice.system, *revolution};
  }
}

std::string UnitScale::position(std::int32_t in_drive_units) const {
  const UnitNames& names = names_of(system);
  return number_with_unit(in_drive_units / drive.position, names.position_digits, names.position);
}

std::string UnitScale::velocity(std::int32_t in_drive_units) const {
  const UnitNames& names = names_of(system);
  return number_with_unit(in_drive_units / drive.velocity, names.velocity_digits, names.velocity);
}

}  // namespace servodrome::master
