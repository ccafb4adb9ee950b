// `run`: carries out a motion script.
#include "tools/script/run.hpp"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <functional>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "app/commands.hpp"
#include "app/drive_group.hpp"
#include "app/object_names.hpp"
#include "app/script_file.hpp"
#include "app/whole_file.hpp"
#include "links/time.hpp"

namespace servodrome::app {
namespace run_command {

using master::script::Script;
using master::script::Step;

struct Options {
  BusOptions bus{.timeout_is_for_motion = true};
  std::string script;
  std::string eds;
  bool check = false;
  bool quiet = false;
  bool disable = false;
};

std::string text_of(const Options& options) {
  return read_text_file(options.script, fmt::format("run: {}", options.script), true);
}

Script parsed(const Options& options) {
  const std::string name = options.script == "-" ? "standard input" : options.script;
  const auto sheet = data_sheet(options.eds);
  return parse_script(text_of(options), name, options.bus, sheet ? &*sheet : nullptr);
}

// Checks the axes before anything moves: a port that has parameters only cannot command motion.
void check_axes(const Script& script, const std::vector<Step>& steps, const std::vector<master::Axis402*>& axes) {
  for (const Step& step : steps) {
    check_axes(script, step.body, axes);
    if (!master::script::needs_axis(step)) continue;
    master::ObjectClient& objects = axes[step.axis]->objects();
    const bool is_modbus = dynamic_cast<master::ModbusObjects*>(&objects) != nullptr;
    if (!is_modbus || objects.read_if_present<std::uint16_t>(0x6041)) continue;
    throw Failure::wrong_use(
        fmt::format("{}:{}:{}: `{}`: {}: this port has parameters and monitoring items, and neither controlword nor "
                    "statusword; nothing was moved",
                    script.file, step.place.line, step.place.column, step.source, objects.where()));
  }
}

// Stops and disables the axes after the script has succeeded. Tries all of them, then throws ScriptFailure with the
// first error.
void switch_off(const Script& script, const std::vector<master::Axis402*>& axes) {
  std::string problem;
  for (master::Axis402* axis : axes) {
    try {
      axis->stop();
      axis->disable();
    } catch (const master::MasterError& error) {
      if (problem.empty()) problem = error.what();
      axis->try_to_switch_off();
    }
  }
  if (problem.empty()) return;
  const auto place = script.steps.empty() ? script.axes.front().place : script.steps.back().place;
  throw master::script::ScriptFailure(script.file, place, "at the end of the script: " + problem);
}

void carry_out(const Options& options, const Script& script, nlohmann::ordered_json& steps) {
  std::vector<DriveGroup::Member> members;
  const std::vector<bool> is_commanded = master::script::commanded_axes(script);
  for (std::size_t i = 0; i < script.axes.size(); ++i) {
    members.push_back({script.axes[i].node, script.axes[i].product, is_commanded[i]});
  }
  const InterruptGuard guard;
  master::script::Cancellation cancellation(InterruptGuard::interrupted);
  DriveGroup group(options.bus, members, std::ref(cancellation));
  const std::vector<master::Axis402*>& axes = group.axes();
  check_axes(script, script.steps, axes);
  master::script::RunOptions run_options;
  run_options.cancellation = &cancellation;
  // Another program may move the axes that the script only reads, or has not commanded yet.
  std::vector<master::Axis402*> commanded;
  run_options.began = [&](const Step& step) {
    master::Axis402* const axis = axes[step.axis];
    const bool is_known = std::find(commanded.begin(), commanded.end(), axis) != commanded.end();
    if (master::script::commands_axis(step) && !is_known) commanded.push_back(axis);
    if (step.verb == master::script::Verb::enable && group.has_lost_watch(step.axis)) group.renew_watch(step.axis);
  };
  run_options.progress = [shown = motion_progress(*axes.front(), options.bus.json || options.quiet)](
                             const master::AxisStatus& status) mutable { shown(status); };
  run_options.done = [&](const Step& step, master::Time took, const std::string& said) {
    const double seconds = links::to_seconds(took);
    if (options.bus.json) {
      steps.push_back({{"line", step.place.line}, {"text", step.source}, {"seconds", seconds}, {"said", said}});
      return;
    }
    end_progress(options.quiet);
    const bool speaks = step.verb == master::script::Verb::print || step.verb == master::script::Verb::get ||
                        step.verb == master::script::Verb::wait_probe;
    if (options.quiet) {
      if (speaks) fmt::print("{}\n", said);
    } else if (step.verb == master::script::Verb::print) {
      fmt::print("{:>5}  {}\n", step.place.line, said);
    } else {
      fmt::print("{:>5}  {:<50} {:8.3f} s{}{}\n", step.place.line, step.source, seconds, said.empty() ? "" : "  ",
                 said);
    }
    // If its output is lost, the script ends, and its axes stop.
    if (std::fflush(stdout) != 0) throw Failure::lost_output();
  };
  try {
    master::script::run(script, axes, run_options);
  } catch (...) {
    end_progress(options.bus.json || options.quiet);
    for (master::Axis402* axis : commanded) axis->try_to_switch_off();
    throw;
  }
  if (group.operates() || options.disable) switch_off(script, commanded);
}

void run(const Options& options) {
  const Script script = parsed(options);
  if (options.check) {
    if (options.bus.json) {
      fmt::print("{}\n", nlohmann::ordered_json{{"script", script.file},
                                                {"axes", script.axes.size()},
                                                {"steps", script.count_steps()},
                                                {"mistakes", nlohmann::ordered_json::array()}}
                             .dump(2));
    } else {
      fmt::print("{}: {} steps for {} {}, no mistakes\n", script.file, script.count_steps(), script.axes.size(),
                 script.axes.size() == 1 ? "axis" : "axes");
    }
    return;
  }
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  nlohmann::ordered_json json{{"script", script.file}, {"passed", true}};
  std::string problem;
  try {
    carry_out(options, script, steps);
  } catch (const master::script::ScriptFailure& failure) {
    problem = failure.what();
    json["passed"] = false;
    json["failure"] = {
        {"line", failure.place().line}, {"column", failure.place().column}, {"message", failure.message()}};
  }
  json["steps"] = std::move(steps);
  if (options.bus.json) {
    fmt::print("{}\n", json.dump(2));
    std::fflush(stdout);
  }
  if (!problem.empty()) throw Failure::did_not_work(problem);
}

}  // namespace run_command

void add_run(CLI::App& app) {
  const auto [command, options] =
      add_command(app, "run",
                  "Run a motion script: commands for one axis or several, with waits and expectations; "
                  "docs/script.md describes the language. Exit status 1 and the line if a command fails",
                  run_command::run);
  command->add_option("SCRIPT", options->script, "File; - for standard input")->required();
  command->add_flag("--check", options->check, "Check the script only; no bus is opened");
  command->add_flag("--quiet", options->quiet, "Print only what the script prints, gets and probes");
  command->add_option("--eds", options->eds, "Electronic data sheet with the drives' own objects, names and types");
  add_bus_options(*command, options->bus, "Seconds");
  command->remove_option(command->get_option("--timeout"));
  add_node_option(*command, options->bus);
  add_serial_options(*command, options->bus);
  add_watch_option(*command, options->bus);
  add_cycle_options(*command, options->bus);
  command->add_flag("--disable", options->disable,
                    "Disable the drives at the end; otherwise drives that the script enabled or moved hold their "
                    "position (not on EtherCAT)");
}

}  // namespace servodrome::app
