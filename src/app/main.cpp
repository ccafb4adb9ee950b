#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "app/commands.hpp"
#include "line/nearest_name.hpp"

namespace {

using namespace servodrome::app;

constexpr std::array commands{
    add_up,     add_check, add_products, add_export, add_scan,  add_get,    add_set,
    add_home,   add_move,  add_monitor,  add_nmt,    add_prove, add_state,  add_conform,
    add_faults, add_jog,   add_torque,   add_probe,  add_run,   add_params, add_sniff,
};

int report(int exit_status, std::string_view message) {
  fmt::print(stderr, "servodrome: {}\n", message);
  return exit_status;
}

// CLI11 reports a mistyped command as a missing one.
void refuse_unknown_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  const std::vector<const CLI::App*> known = app.get_subcommands([](const CLI::App*) { return true; });
  std::vector<std::string> names;
  names.reserve(known.size());
  for (const CLI::App* command : known) names.push_back(command->get_name());
  if (std::find(names.begin(), names.end(), argv[1]) != names.end()) return;
  const std::vector<std::string_view> views(names.begin(), names.end());
  throw Failure::wrong_use(
      fmt::format("there is no command \"{}\"; {}", argv[1], servodrome::line::suggestion(argv[1], views)));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Software servo drives on real field buses, and the tools to commission them.", "servodrome");
  app.set_version_flag("--version", "servodrome " SERVODROME_VERSION);
  app.require_subcommand(1);
  app.failure_message(CLI::FailureMessage::simple);
  for (const auto add : commands) add(app);
  try {
    refuse_unknown_command(app, argc, argv);
    app.parse(argc, argv);
    const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    return written ? 0
                   : report(1, "the output is not complete: standard output could not be written; is the disk full?");
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    return report(
        2, fmt::format("{}; `servodrome --help` and `servodrome COMMAND --help` show what there is", error.what()));
  } catch (const Failure& failure) {
    return report(failure.exit_status(), failure.what());
  } catch (const std::exception& error) {
    return report(1, error.what());
  }
}
