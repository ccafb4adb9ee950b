// `probe`: prints the position of the axis at an edge of a touch probe.
#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/motion_run.hpp"

namespace servodrome::app {
namespace probe_command {

struct Options : MotionOptions {
  unsigned probe = 1;
  std::string source = "input";
  std::string edge = "positive";
  std::optional<double> by;
  std::optional<double> velocity;
};

using Request = master::ProbeRequest;

void run(const Options& options) {
  if (options.velocity && !options.by) throw Failure::wrong_use("probe: --velocity goes with --by DISTANCE");
  const Request request{.probe = static_cast<std::uint8_t>(options.probe),
                        .source = options.source == "index" ? Request::Source::index : Request::Source::input,
                        .positive_edge = options.edge != "negative",
                        .negative_edge = options.edge != "positive"};
  run_motion(options, [&](const Units& units) -> Motion {
    const auto by = units.position(options.by, "--by");
    const master::MotionProfile profile{.velocity = units.velocity(options.velocity, "--velocity")};
    return [&options, request, by, profile](master::Axis402& axis, const master::Axis402::Progress& progress) {
      axis.arm_probe(request);
      master::ProbePositions seen;
      try {
        if (by) axis.start_move_by(*by, profile);
        seen = axis.wait_for_probe(request, options.bus.timeout(), progress);
      } catch (...) {
        if (by) axis.try_to_stop();
        throw;
      }
      if (by) axis.stop();
      axis.disarm_probe(request.probe);
      MotionResult result{fmt::format("touch probe {} detected its edge", request.probe)};
      if (request.positive_edge) result.positions.emplace_back("positive_edge", seen.positive);
      if (request.negative_edge) result.positions.emplace_back("negative_edge", seen.negative);
      return result;
    };
  });
}

}  // namespace probe_command

void add_probe(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "probe",
      "Wait for an edge of a touch probe (60B8h), moving the axis if --by is given, and print the captured position",
      probe_command::run);
  command->add_option("--probe", options->probe, "Touch probe: 1 or 2")
      ->check(CLI::Range(1, 2).description(""))
      ->capture_default_str();
  command->add_option("--source", options->source, "Source of the edge: input, or index (of the encoder)")
      ->check(CLI::IsMember({"input", "index"}))
      ->capture_default_str();
  command->add_option("--edge", options->edge, "Edge: positive, negative or both")
      ->check(CLI::IsMember({"positive", "negative", "both"}))
      ->capture_default_str();
  command->add_option("--by", options->by, "Distance to move while waiting; the axis stops at the edge");
  command->add_option("--velocity", options->velocity, "Velocity of this move (6081h); the drive's if not given");
  add_motion_options(*command, *options, "Seconds to wait for the edge");
}

}  // namespace servodrome::app
