#include <fmt/format.h>

#include "app/bus_links.hpp"
#include "app/commands.hpp"
#include "app/line_files.hpp"
#include "app/line_run.hpp"
#include "app/page_folder.hpp"
#include "line/registry.hpp"
#include "links/link_scheme.hpp"

namespace servodrome::app {
namespace up_command {

struct Options {
  std::string file;
  DescriptionFiles descriptions;  // --eds, --esi
  std::vector<std::string> buses;
  std::string log;
  std::string api;
  std::string studio;
  std::string ready_file;
  bool virtual_time = false;
  bool json = false;
};

line::LineSettings load(const Options& options) {
  if (options.descriptions.empty()) return load_line(options.file);
  if (!options.file.empty()) {
    throw Failure::wrong_use(
        "--eds and --esi make a line of their own; in a line file write description = \"FILE\" in an axis");
  }
  return line_of_descriptions(options.descriptions);
}

line::LineSettings settings_of(const Options& options) {
  line::LineSettings settings = load(options);
  override_links(settings, options.buses);
  if (options.virtual_time) settings.clock = line::ClockMode::virtual_time;
  if (!options.api.empty()) {
    settings.api.enabled = true;
    const std::string problem = line::parse_api_address(options.api, settings.api);
    if (!problem.empty()) {
      throw Failure::wrong_use(fmt::format("--api {}: {}; write --api 127.0.0.1:8402", options.api, problem));
    }
  }
  settings.api.page = page_folder(options.studio);
  return settings;
}

void run(const Options& options) {
  run_line(settings_of(options), {.log = options.log, .ready_file = options.ready_file, .json = options.json});
}

}  // namespace up_command

void add_up(CLI::App& app) {
  const auto [command, options] = add_command(app, "up", "Run a line of drives until Ctrl-C", up_command::run);
  command->add_option("LINE", options->file, "Line file (TOML); the built-in line with five drives if not given");
  command
      ->add_option("--eds", options->descriptions.data_sheets,
                   "Run a drive of this electronic data sheet (EDS, DCF) instead of a line file; may be given several "
                   "times, once per axis")
      ->allow_extra_args(false);
  command
      ->add_option("--esi", options->descriptions.slaves,
                   "Run a drive of this EtherCAT slave information (ESI) instead of a line file; may be given several "
                   "times, once per axis")
      ->allow_extra_args(false);
  command->add_option("--device", options->descriptions.device,
                      "Type, name or product code of the device, if the ESI file has several");
  command
      ->add_option("--bus", options->buses,
                   fmt::format("NAME=LINK or LINK: link of a bus, instead of the one in the line file ({}; {} for "
                               "EtherCAT; {} for an RS485 line)",
                               links::forms(links::can_schemes), links::forms(links::ethercat_schemes_easiest_first),
                               links::forms(links::serial_schemes)))
      ->allow_extra_args(false);
  command->add_option(
      "--log", options->log,
      "Log each CAN bus in candump format (FILE.pcap: pcap), each EtherCAT segment as pcap, each RS485 line as text "
      "(FILE.pcap: pcapng); - is standard output");
  command->add_flag("--virtual", options->virtual_time, "Time passes only when the bench API advances it");
  command->add_option("--api", options->api, "ADDRESS:PORT of the bench API; port 0 lets the system choose");
  command->add_option("--studio", options->studio,
                      "Folder with the studio's page; if not given $SERVODROME_STUDIO, or the one that was built");
  command->add_option("--ready-file", options->ready_file, "Write this file (JSON) when the line is ready");
  command->add_flag("--json", options->json, "Print one JSON object when the line is ready, instead of a table");
}

}  // namespace servodrome::app
