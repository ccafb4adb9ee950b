// `home` and `move`: one axis, by its objects.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"

namespace servodrome::app {
namespace {

struct MotionOptions {
  BusOptions bus{.timeout_s = 60.0, .timeout_is_for_motion = true};
  bool reset_fault = false;
  bool disable = false;
  bool revolutions = false;
};

struct HomeOptions : MotionOptions {
  std::optional<int> method;
  std::optional<double> speed;
  std::optional<double> zero_speed;
  std::optional<double> acceleration;
  std::optional<double> offset;
};

struct MoveOptions : MotionOptions {
  std::optional<double> to;
  std::optional<double> by;
  std::optional<double> velocity;
  std::optional<double> acceleration;
  std::optional<double> deceleration;
};

void add_motion_options(CLI::App& command, MotionOptions& options) {
  add_bus_options(command, options.bus, "Seconds the motion may take");
  add_node_option(command, options.bus);
  add_serial_options(command, options.bus);
  add_cycle_options(command, options.bus);
  command.add_flag("--revolutions", options.revolutions,
                   "Numbers are motor revolutions, /s and /s2, instead of the drive's units");
  command.add_flag("--reset-fault", options.reset_fault, "Reset a fault first");
  command.add_flag("--disable", options.disable,
                   "Disable the drive afterwards instead of holding the position (on EtherCAT always: a drive holds "
                   "while a master exchanges data with it)");
}

// Turns numbers of the command line into the drive's units.
class Units {
 public:
  Units(host::Axis402& axis, bool revolutions) {
    if (!revolutions) return;
    const auto units = axis.units();
    if (!units) {
      throw Failure::did_not_work(
          fmt::format("{}: the drive does not say how many units a revolution has (6092h, 608Fh); give the numbers "
                      "in the drive's units, without --revolutions",
                      axis.objects().where()));
    }
    units_ = *units;
  }

  std::optional<std::int32_t> position(const std::optional<double>& number, const char* option) const {
    return in_units<std::int32_t>(number, units_.position, option);
  }
  std::optional<std::uint32_t> velocity(const std::optional<double>& number, const char* option) const {
    return in_units<std::uint32_t>(number, units_.velocity, option);
  }
  std::optional<std::uint32_t> acceleration(const std::optional<double>& number, const char* option) const {
    return in_units<std::uint32_t>(number, units_.acceleration, option);
  }

 private:
  template <typename T>
  static std::optional<T> in_units(const std::optional<double>& number, double scale, const char* option) {
    if (!number) return std::nullopt;
    return whole_units<T>(*number * scale, option, *number);
  }

  host::AxisUnits units_{1.0, 1.0, 1.0};
};

// A slave that leaves OP with its motor on takes that for a fault.
void disable_if_possible(host::Axis402& axis) {
  try {
    axis.disable();
  } catch (const host::HostError&) {
    // What went wrong before is told.
  }
}

// Lets `plan` make a motion of the options, enables the drive, lets the motion run, and says where the axis is. Options
// that cannot be followed leave the drive as it was.
template <typename Plan>
void run(const MotionOptions& options, const char* done, const Plan& plan) {
  DriveLink link(options.bus, true);
  link.operate(options.bus);
  const auto opened = link.open_axis({});
  host::Axis402& axis = *opened;
  const auto motion = plan(Units(axis, options.revolutions));
  const InterruptGuard guard;
  host::Time start{};
  try {
    if (options.reset_fault) axis.reset_fault();
    axis.enable();
    start = link.objects().now();
    motion(axis, motion_progress(axis, options.bus.json));
  } catch (...) {
    if (link.operates()) disable_if_possible(axis);
    throw;
  }
  const double seconds = std::chrono::duration<double>(link.objects().now() - start).count();
  end_progress(options.bus.json);
  const std::int32_t position = axis.position();
  if (options.disable || link.operates()) axis.disable();
  if (options.bus.json) {
    fmt::print("{}\n", nlohmann::ordered_json{{"node", axis.address()},
                                              {"result", done},
                                              {"position", position},
                                              {"seconds", seconds},
                                              {"state", drive::name(axis.state())}}
                           .dump(2));
  } else {
    fmt::print("{} {}: {} in {:.2f} s, position {}\n", link.noun(), axis.address(), done, seconds, position);
  }
}

void home(const HomeOptions& options) {
  run(options, "homed", [&](const Units& units) {
    host::HomingRequest request;
    if (options.method) request.method = static_cast<std::int8_t>(*options.method);
    request.switch_speed = units.velocity(options.speed, "--speed");
    request.zero_speed = units.velocity(options.zero_speed, "--zero-speed");
    request.acceleration = units.acceleration(options.acceleration, "--acceleration");
    request.offset = units.position(options.offset, "--offset");
    return [&options, request](host::Axis402& axis, const host::Axis402::Progress& progress) {
      axis.home(request, options.bus.timeout(), progress);
    };
  });
}

void move(const MoveOptions& options) {
  if (options.to.has_value() == options.by.has_value()) {
    throw Failure::wrong_use("move: give --to POSITION or --by DISTANCE, one of them");
  }
  run(options, "moved", [&](const Units& units) {
    const host::MotionProfile profile{
        .velocity = units.velocity(options.velocity, "--velocity"),
        .acceleration = units.acceleration(options.acceleration, "--acceleration"),
        .deceleration =
            units.acceleration(options.deceleration ? options.deceleration : options.acceleration, "--deceleration")};
    const auto to = units.position(options.to, "--to");
    const auto by = units.position(options.by, "--by");
    return [&options, profile, to, by](host::Axis402& axis, const host::Axis402::Progress& progress) {
      if (to) {
        axis.move_to(*to, profile, options.bus.timeout(), progress);
      } else {
        axis.move_by(*by, profile, options.bus.timeout(), progress);
      }
    };
  });
}

}  // namespace

void add_home(CLI::App& app) {
  const auto options = std::make_shared<HomeOptions>();
  CLI::App* command = app.add_subcommand("home", "Enable a drive and home it");
  command->add_option("--method", options->method, "Homing method (6098h); the drive's if not given")
      ->check(CLI::Range(-128, 127).description(""));
  command->add_option("--speed", options->speed,
                      "Speed during search for the switch (6099h sub 1); the drive's if not given");
  command->add_option("--zero-speed", options->zero_speed, "Speed during search for zero (6099h sub 2)");
  command->add_option("--acceleration", options->acceleration, "Homing acceleration (609Ah)");
  command->add_option("--offset", options->offset, "Home offset (607Ch)");
  add_motion_options(*command, *options);
  command->callback([options] { home(*options); });
}

void add_move(CLI::App& app) {
  const auto options = std::make_shared<MoveOptions>();
  CLI::App* command = app.add_subcommand("move", "Enable a drive and move it in profile position mode");
  command->add_option("--to", options->to, "Target position");
  command->add_option("--by", options->by, "Distance from the last target");
  command->add_option("--velocity", options->velocity, "Profile velocity (6081h); the drive's if not given");
  command->add_option("--acceleration", options->acceleration, "Profile acceleration (6083h)");
  command->add_option("--deceleration", options->deceleration,
                      "Profile deceleration (6084h); as --acceleration if not given");
  add_motion_options(*command, *options);
  command->callback([options] { move(*options); });
}

}  // namespace servodrome::app
