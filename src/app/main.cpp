#include <algorithm>
#include <array>
#include <cstdio>
#include <fmt/format.h>
#include <iostream>

#include "api/version.hpp"
#include "app/commands.hpp"
#include "app/help_formatter.hpp"
#include "app/interrupt_status.hpp"
#include "app/process.hpp"
#include "app/reference_commands.hpp"
#include "links/nearest_name.hpp"

namespace {

using namespace servodrome::app;

constexpr std::array commands{
    add_up,     add_check,      add_products, add_export, add_scan,    add_get,     add_set,     add_home,
    add_move,   add_monitor,    add_nmt,      add_prove,  add_state,   add_conform, add_faults,  add_jog,
    add_torque, add_probe,      add_run,      add_params, add_disable, add_sniff,   add_studio,  add_scope,
    add_tune,   add_completion, add_manual,   add_clone,  add_fit,     add_trial,   add_changes,
};

int report(int exit_status, std::string_view message) {
  warn(std::string(message));
  return exit_status;
}

int report_lost_output() { return report(1, Failure::lost_output().what()); }

int end_of_output() {
  const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  return written ? 0 : report_lost_output();
}

// A command that a signal ended returns the status that shells use for a killed program, 128 + signal.
int status_of(int exit_status) {
  const int signal = interrupting_signal();
  return exit_status == 1 && signal != 0 ? 128 + signal : exit_status;
}

// An empty value would act like a missing option, as in `--velocity "$v"` with an empty v in a script.
void refuse_empty_values(CLI::App& app) {
  for (CLI::Option* option : app.get_options([](CLI::Option* one) { return one->nonpositional(); })) {
    if (option->get_type_size() == 0) continue;
    option->check(CLI::Validator(
        [](const std::string& value) { return value.empty() ? std::string("a value is missing") : std::string(); }, "",
        ""));
  }
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) refuse_empty_values(*command);
}

// CLI11 reports an unknown command as a missing one.
void refuse_unknown_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  const std::vector<const CLI::App*> known = app.get_subcommands([](const CLI::App*) { return true; });
  std::vector<std::string> names;
  names.reserve(known.size());
  for (const CLI::App* command : known) names.push_back(command->get_name());
  if (std::find(names.begin(), names.end(), argv[1]) != names.end()) return;
  const std::vector<std::string_view> views(names.begin(), names.end());
  throw Failure::wrong_use(
      fmt::format("there is no command \"{}\"; {}", argv[1], servodrome::links::suggestion(argv[1], views)));
}

}  // namespace

// An error of the output is ignored: the caller may be about to stop an axis.
void servodrome::app::warn(const std::string& message) {
  std::fputs(fmt::format("servodrome: {}\n", message).c_str(), stderr);
}

int main(int argc, char** argv) {
  begin_process();
  CLI::App app("Software servo drives on real field buses, and the tools to commission them.", "servodrome");
  app.set_version_flag("--version", fmt::format("servodrome {}", servodrome::api::version()));
  app.require_subcommand(1);
  app.failure_message(CLI::FailureMessage::simple);
  app.formatter(std::make_shared<HelpFormatter>());
  for (const auto add : commands) add(app);
  refuse_empty_values(app);
  try {
    refuse_unknown_command(app, argc, argv);
    app.parse(argc, argv);
    return end_of_output();
  } catch (const CLI::Success& success) {  // --help, --version
    app.exit(success);
    std::cout.flush();
    return std::cout ? end_of_output() : report_lost_output();
  } catch (const CLI::ParseError& error) {
    return report(2, fmt::format("{}; `servodrome --help` lists the commands, `servodrome COMMAND --help` its options",
                                 error.what()));
  } catch (const Failure& failure) {
    return report(status_of(failure.exit_status()), failure.what());
  } catch (const std::exception& error) {
    return report(status_of(1), error.what());
  }
}
