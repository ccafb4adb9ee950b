// `home` and `move`: motions of one axis, commanded through its objects.
#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/motion_run.hpp"
#include "axis/cia402_words.hpp"

namespace servodrome::app {
namespace motion_command {

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

void home(const HomeOptions& options) {
  run_motion(options, [&](const Units& units) -> Motion {
    master::HomingRequest request;
    if (options.method) request.method = static_cast<std::int8_t>(*options.method);
    request.switch_speed = units.velocity(options.speed, "--speed");
    request.zero_speed = units.velocity(options.zero_speed, "--zero-speed");
    request.acceleration = units.acceleration(options.acceleration, "--acceleration");
    request.offset = units.position(options.offset, "--offset");
    return [&options, request](master::Axis402& axis, const master::Axis402::Progress& progress) {
      axis.home(request, options.bus.timeout(), progress);
      return MotionResult{"homed"};
    };
  });
}

void move(const MoveOptions& options) {
  if (options.to.has_value() == options.by.has_value()) {
    throw Failure::wrong_use("move: give --to POSITION or --by DISTANCE, one of them");
  }
  run_motion(options, [&](const Units& units) -> Motion {
    const master::MotionProfile profile{
        .velocity = units.velocity(options.velocity, "--velocity"),
        .acceleration = units.acceleration(options.acceleration, "--acceleration"),
        .deceleration =
            units.acceleration(options.deceleration ? options.deceleration : options.acceleration, "--deceleration")};
    const auto to = units.position(options.to, "--to");
    const auto by = units.position(options.by, "--by");
    return [&options, profile, to, by](master::Axis402& axis, const master::Axis402::Progress& progress) {
      if (to) {
        axis.move_to(*to, profile, options.bus.timeout(), progress);
      } else {
        axis.move_by(*by, profile, options.bus.timeout(), progress);
      }
      return MotionResult{"moved"};
    };
  });
}

// False if the motor may have torque, or the drive does not answer.
bool is_off(master::Axis402& axis) {
  try {
    return !master::may_have_torque(axis.state());
  } catch (const master::MasterError&) {
    return false;
  }
}

// Works in any mode, whichever master enabled the drive. It needs no process data: the motor of an EtherCAT slave
// outside OP is off already, or is switched off here.
void disable(const BusOptions& options) {
  DriveLink link(options, true);
  const InterruptGuard guard;
  const auto axis = link.open_axis({});
  try {
    axis->stop();
    axis->disable();
  } catch (const master::MasterError& error) {
    axis->try_to_switch_off();
    if (!is_off(*axis)) throw;
    warn(fmt::format("{}. The motor is off nevertheless", error.what()));
  }
  const char* const state = drive::name(axis->state());
  if (options.json) {
    fmt::print("{}\n", nlohmann::ordered_json{{"node", axis->address()}, {"state", state}}.dump(2));
  } else {
    fmt::print("{} {}: {}\n", link.noun(), axis->address(), state);
  }
}

}  // namespace motion_command

void add_disable(CLI::App& app) {
  const auto [command, options] =
      add_command(app, "disable", "Stop a drive, whatever it does, and switch its motor off", motion_command::disable);
  add_drive_options(*command, *options, "Seconds to wait for each answer");
}

void add_home(CLI::App& app) {
  const auto [command, options] = add_command(app, "home", "Enable a drive and home it", motion_command::home);
  command->add_option("--method", options->method, "Homing method (6098h); the drive's if not given")
      ->check(CLI::Range(-128, 127).description(""));
  command->add_option("--speed", options->speed,
                      "Speed during search for the switch (6099h sub 1); the drive's if not given");
  command->add_option("--zero-speed", options->zero_speed, "Speed during search for zero (6099h sub 2)");
  command->add_option("--acceleration", options->acceleration, "Homing acceleration (609Ah)");
  command->add_option("--offset", options->offset, "Home offset (607Ch)");
  add_motion_options(*command, *options, "Seconds to wait until the motion is complete");
}

void add_move(CLI::App& app) {
  const auto [command, options] =
      add_command(app, "move", "Enable a drive and move it in profile position mode", motion_command::move);
  command->add_option("--to", options->to, "Target position");
  command->add_option("--by", options->by, "Distance from the last target");
  command->add_option("--velocity", options->velocity, "Profile velocity (6081h); the drive's if not given");
  command->add_option("--acceleration", options->acceleration, "Profile acceleration (6083h)");
  command->add_option("--deceleration", options->deceleration,
                      "Profile deceleration (6084h); as --acceleration if not given");
  add_motion_options(*command, *options, "Seconds to wait until the motion is complete");
}

}  // namespace servodrome::app
