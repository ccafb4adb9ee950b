// `jog` and `torque`: motions that last as long as the user wants.
#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/motion_run.hpp"
#include "axis/cia402_words.hpp"
#include "axis/jog_keys.hpp"
#include "links/time.hpp"

namespace servodrome::app {
namespace jog_command {

struct JogOptions : MotionOptions {
  double velocity = 0.0;
  std::optional<double> acceleration;
  std::optional<double> seconds;
};

struct TorqueOptions : MotionOptions {
  double percent = 0.0;
  std::optional<double> slope;
  double seconds = 0.0;
};

void jog(const JogOptions& options) {
  if (!options.seconds && !(has_keyboard() && on_terminal())) {
    throw Failure::wrong_use(
        "jog: standard input or output is not a terminal, so keys cannot be read; give the duration with --seconds");
  }
  run_motion(options, [&](const Units& units) -> Motion {
    const auto velocity = units.velocity<std::int32_t>(options.velocity, "--velocity");
    const auto acceleration = units.acceleration(options.acceleration, "--acceleration");
    const master::MotionProfile profile{.acceleration = acceleration, .deceleration = acceleration};
    return [&options, velocity, profile](master::Axis402& axis, const master::Axis402::Progress& progress) {
      if (options.seconds) {
        const auto duration = links::from_seconds(*options.seconds);
        axis.jog_for(duration, velocity, profile, progress);
      } else {
        const auto now = [&axis] { return axis.objects().now(); };
        fmt::print("hold the right or left arrow key to move; up, down: faster, slower; space: stop; q: end\n");
        const Keyboard keyboard;
        master::JogKeys keys(velocity);
        axis.jog(
            profile,
            [&](const master::AxisStatus& status) {
              keys.feed(Keyboard::typed(), now());
              progress(status);
              return keys.velocity(now());
            },
            true);
      }
      return MotionResult{"jogged"};
    };
  });
}

void torque(const TorqueOptions& options) {
  const auto permille = whole_units<std::int16_t>(options.percent * 10.0, "--percent", options.percent);
  master::TorqueProfile profile;
  if (options.slope) profile.slope = whole_units<std::uint32_t>(*options.slope * 10.0, "--slope", *options.slope);
  run_motion(options, [&](const Units&) -> Motion {
    return [&options, permille, profile](master::Axis402& axis, const master::Axis402::Progress& progress) {
      const auto seconds = links::from_seconds(options.seconds);
      std::optional<double> most_percent;
      bool reached = false;
      try {
        axis.start_torque(permille, profile);
        axis.hold_for(seconds, [&](const master::AxisStatus& status) {
          if (status.has_torque) most_percent = std::max(most_percent.value_or(0), std::abs(status.torque) / 10.0);
          reached = reached || (status.statusword & master::status_bit::target_reached) != 0;
          progress(status);
        });
      } catch (...) {
        axis.try_to_stop();
        throw;
      }
      axis.stop();
      MotionResult result{reached ? "applied torque and stopped"
                                  : "stopped before the drive reported the torque as reached"};
      result.details["reached"] = reached;
      result.details["most_percent"] = most_percent ? nlohmann::ordered_json(*most_percent) : nullptr;
      return result;
    };
  });
}

}  // namespace jog_command

void add_jog(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "jog",
      "Enable a drive and run it in profile velocity while an arrow key is held, or for some seconds; then stop it",
      jog_command::jog);
  command->add_option("--velocity", options->velocity, "Velocity (60FFh); with --seconds its sign is the direction")
      ->required();
  command->add_option("--acceleration", options->acceleration,
                      "Acceleration and deceleration (6083h, 6084h); the drive's if not given");
  add_seconds_option(*command, options->seconds, "Duration in seconds; no keys are read")
      ->check(number_within(0.001, 1e6));
  add_motion_options(*command, *options, "Ignored: jogging ends after --seconds or with a key");
  command->remove_option(command->get_option("--timeout"));
}

void add_torque(CLI::App& app) {
  const auto [command, options] =
      add_command(app, "torque",
                  "Enable a drive, apply a torque in profile torque mode for some seconds, and "
                  "stop it. Without a load the drive accelerates up to its speed limits",
                  jog_command::torque);
  command->add_option("--percent", options->percent, "Target torque (6071h) in % of the rated torque")
      ->required()
      ->check(number_within(-1000.0, 1000.0));
  command->add_option("--slope", options->slope, "Torque slope (6087h) in % of the rated torque per second")
      ->check(number_within(0.1, 1e6));
  add_seconds_option(*command, options->seconds, "Duration in seconds")->required()->check(number_within(0.001, 1e6));
  add_motion_options(*command, *options, "Ignored: the torque ends after --seconds");
  command->remove_option(command->get_option("--timeout"));
}

}  // namespace servodrome::app
