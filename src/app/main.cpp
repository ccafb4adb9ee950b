#include <array>
#include <fmt/format.h>

#include "app/commands.hpp"

namespace {

using namespace servodrome::app;

constexpr std::array commands{add_up,  add_check, add_products, add_export,  add_scan, add_get,
                              add_set, add_home,  add_move,     add_monitor, add_nmt,  add_prove};

int report(int exit_status, std::string_view message) {
  fmt::print(stderr, "servodrome: {}\n", message);
  return exit_status;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Software servo drives on real field buses, and the tools to commission them.", "servodrome");
  app.set_version_flag("--version", "servodrome " SERVODROME_VERSION);
  app.require_subcommand(1);
  app.failure_message(CLI::FailureMessage::simple);
  for (const auto add : commands) add(app);
  try {
    app.parse(argc, argv);
    return 0;
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
