#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.hpp"
#include "line/line_file.hpp"

namespace servodrome::app {
namespace check_command {

struct Options {
  std::string file;
  bool json = false;
};

nlohmann::ordered_json json_of(const std::vector<line::Diagnostic>& diagnostics) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const line::Diagnostic& diagnostic : diagnostics) {
    list.push_back({{"file", diagnostic.file},
                    {"line", diagnostic.line},
                    {"column", diagnostic.column},
                    {"what", diagnostic.what},
                    {"hint", diagnostic.hint}});
  }
  return list;
}

void check(const Options& options) {
  const line::LineFile loaded = line::load_line_file(options.file, line::all_products());
  if (options.json) {
    const nlohmann::ordered_json result{{"ok", loaded.diagnostics.empty()},
                                        {"problems", json_of(loaded.diagnostics)},
                                        {"warnings", json_of(loaded.warnings)}};
    fmt::print("{}\n", result.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  } else {
    for (const line::Diagnostic& diagnostic : loaded.diagnostics) fmt::print("{}\n", to_string(diagnostic));
    for (const line::Diagnostic& warning : loaded.warnings) fmt::print("warning: {}\n", to_string(warning));
    if (loaded.diagnostics.empty()) {
      const auto counted = [](std::size_t count, const char* one, const char* many) {
        return fmt::format("{} {}", count, count == 1 ? one : many);
      };
      const line::LineSettings& line = loaded.settings;
      const std::size_t buses = line.buses.size() + line.serial_buses.size() + line.ethercat_buses.size();
      const std::string doubted =
          loaded.warnings.empty() ? "" : fmt::format(", {}", counted(loaded.warnings.size(), "warning", "warnings"));
      fmt::print("{}: {} on {}, no errors{}\n", options.file, counted(line.axes.size(), "axis", "axes"),
                 counted(buses, "bus", "buses"), doubted);
    }
  }
  if (!loaded.diagnostics.empty()) {
    const std::size_t errors = loaded.diagnostics.size();
    throw Failure::wrong_use(fmt::format("{}: {} {}", options.file, errors, errors == 1 ? "error" : "errors"));
  }
}

}  // namespace check_command

void add_check(CLI::App& app) {
  const auto [command, options] =
      add_command(app, "check", "Check a line file and report errors with line and column", check_command::check);
  command->add_option("FILE", options->file, "Line file (TOML)")->required();
  command->add_flag("--json", options->json, "Print JSON");
}

}  // namespace servodrome::app
