#include "app/unit_options.hpp"

#include "app/commands.hpp"
#include "app/number_options.hpp"

namespace servodrome::app {

using master::UnitSystem;

master::UnitChoice UnitOptions::choice() const {
  const master::UnitChoice choice{.system = revolutions ? UnitSystem::revolutions : *master::unit_system_named(name),
                                  .units_per_revolution = units_per_revolution,
                                  .feed_mm = feed_mm};
  const bool in_millimetres = choice.system == UnitSystem::millimetres;
  if (in_millimetres && !feed_mm) {
    throw Failure::wrong_use("--units mm: give the feed per motor revolution in mm with --feed");
  }
  if (!in_millimetres && feed_mm) throw Failure::wrong_use("--feed goes with --units mm");
  const bool of_revolution = choice.system != UnitSystem::drive && choice.system != UnitSystem::counts;
  if (units_per_revolution && !of_revolution) {
    throw Failure::wrong_use(fmt::format("--units-per-revolution does not apply to --units {}", name));
  }
  return choice;
}

master::UnitScale scale_of(master::Axis402& axis, const master::UnitChoice& choice) {
  return master::UnitScale::of(axis, choice, "give them with --units-per-revolution NUMBER");
}

void add_unit_options(CLI::App& command, UnitOptions& options) {
  CLI::Option* const units =
      command
          .add_option(
              "--units", options.name,
              "Units of positions, velocities (per s) and accelerations (per s2): drive (the drive's user-defined "
              "units), counts (of the encoder), revolutions, rpm (revolutions, rpm, rpm/s), degrees, or mm with --feed")
          ->check([](const std::string& word) {
            return master::unit_system_named(word) ? std::string() : "units are " + master::list_of_unit_systems();
          })
          ->capture_default_str();
  command.add_flag("--revolutions", options.revolutions, "Short for --units revolutions")->excludes(units);
  command.add_option("--feed", options.feed_mm, "Feed per motor revolution in mm, for --units mm")
      ->check(number_within(1e-6, 1e6));
  command
      .add_option("--units-per-revolution", options.units_per_revolution,
                  "Position units of the drive per motor revolution, if the drive does not report them (ISMC)")
      ->check(number_within(1e-3, 1e9));
}

}  // namespace servodrome::app
