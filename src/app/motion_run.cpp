#include "app/motion_run.hpp"

#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "links/time.hpp"

namespace servodrome::app {

void add_motion_options(CLI::App& command, MotionOptions& options, const std::string& timeout_help) {
  add_drive_options(command, options.bus, timeout_help);
  add_watch_option(command, options.bus);
  add_cycle_options(command, options.bus);
  add_unit_options(command, options.units);
  command.add_flag("--reset-fault", options.reset_fault, "Reset a fault first");
  command.add_flag("--disable", options.disable,
                   "Disable the drive afterwards instead of holding the position (on EtherCAT always, because a drive "
                   "holds its position only while a master exchanges data with it)");
}

void run_motion(const MotionOptions& options, const std::function<Motion(const Units&)>& plan) {
  const master::UnitChoice choice = options.units.choice();
  const InterruptGuard guard;
  DriveLink link(options.bus, true);
  link.operate(options.bus);
  const auto opened = link.open_axis({});
  master::Axis402& axis = *opened;
  const master::UnitScale scale = scale_of(axis, choice);
  const Motion motion = plan(Units(scale));
  master::Time start{};
  MotionResult result;
  double seconds = 0.0;
  std::int32_t position = 0;
  try {
    if (options.reset_fault) axis.reset_fault();
    axis.enable();
    start = link.objects().now();
    result = motion(axis, motion_progress(axis, options.bus.json, scale));
    seconds = links::to_seconds(link.objects().now() - start);
    position = axis.position();
    // A slave that leaves OP while its motor is on goes to fault.
    if (options.disable || link.operates()) axis.disable();
  } catch (...) {
    end_progress(options.bus.json);
    axis.try_to_switch_off();
    throw;
  }
  end_progress(options.bus.json);
  if (options.bus.json) {
    const bool in_others = scale.system != master::UnitSystem::drive;
    nlohmann::ordered_json json{{"node", axis.address()}, {"result", result.done}};
    const auto add = [&](const std::string& name, const std::optional<std::int32_t>& value) {
      json[name] = value ? nlohmann::ordered_json(*value) : nullptr;
      if (in_others) json[name + "_in_units"] = value ? nlohmann::ordered_json(*value / scale.drive.position) : nullptr;
    };
    if (in_others) json["units"] = master::names_of(scale.system).word;
    add("position", position);
    json["seconds"] = seconds;
    json["state"] = drive::name(axis.state());
    for (const auto& [name, value] : result.positions) add(name, value);
    json.update(result.details);
    fmt::print("{}\n", json.dump(2));
    return;
  }
  std::string details;
  for (const auto& [name, value] : result.positions) {
    details += fmt::format(", {} {}", name, value ? scale.position(*value) : "-");
  }
  for (const auto& [name, value] : result.details.items()) {
    if (!value.is_null()) details += fmt::format(", {} {}", name, value.dump());
  }
  fmt::print("{} {}: {} in {:.2f} s, position {}{}\n", link.noun(), axis.address(), result.done, seconds,
             scale.position(position), details);
}

}  // namespace servodrome::app
